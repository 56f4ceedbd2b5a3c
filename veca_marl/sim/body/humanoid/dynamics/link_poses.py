"""Poses and mass properties of all links in the world's axes."""

from __future__ import annotations

import numpy as np
from numba import njit

from veca_marl.sim.body.anatomy import rotate_about_axis
from veca_marl.sim.body.humanoid.dynamics.small_vectors import (
    add_rotated,
    cross_into,
    multiply_into,
)
from veca_marl.sim.body.humanoid.dynamics.tree import LinkTree
from veca_marl.sim.body.humanoid.link_tree import LinkArrays
from veca_marl.sim.geometry import Floats


@njit(cache=True)
def locate_links(tree: LinkTree, rotation: Floats, angles: Floats, links: LinkArrays) -> None:
    """Write where the links are.

    Args:
        tree: The tree of n hinges.
        rotation: ``(3, 3)`` of the base.
        angles: ``(n,)`` rad.
        links: Written.
    """
    turned, centre = np.empty((3, 3)), np.empty(3)
    links.rotations[0] = rotation
    links.origins[0] = 0.0
    for link in range(tree.parents.shape[0]):
        if link > 0:
            _place_on_parent(tree, link, angles[link - 1], links, turned)
        centre[:] = links.origins[link]
        add_rotated(links.rotations[link], tree.centres[link], centre)
        for i in range(3):
            links.moments[link, i] = tree.masses[link] * centre[i]
        multiply_into(links.rotations[link], tree.inertias[link], turned)
        _write_inertia(
            turned, links.rotations[link], tree.masses[link], centre, links.inertias[link]
        )


@njit(cache=True)
def _place_on_parent(
    tree: LinkTree, link: int, angle: float, links: LinkArrays, turned: Floats
) -> None:
    """Write rotation, origin and hinge of a link from those of its parent."""
    parent, hinge = tree.parents[link], links.hinges[link - 1]
    links.origins[link] = links.origins[parent]
    add_rotated(links.rotations[parent], tree.positions[link], links.origins[link])
    rotate_about_axis(tree.rotations[link], tree.axes[link], angle, turned)
    multiply_into(links.rotations[parent], turned, links.rotations[link])
    hinge[:3] = 0.0
    add_rotated(links.rotations[link], tree.axes[link], hinge[:3])
    cross_into(links.origins[link], hinge[:3], hinge[3:])


@njit(cache=True)
def _write_inertia(
    turned: Floats, rotation: Floats, mass: float, centre: Floats, out: Floats
) -> None:
    """Write ``R I R^T`` and the share of the mass at a distance (Steiner's theorem)."""
    square = centre[0] ** 2 + centre[1] ** 2 + centre[2] ** 2
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                turned[i, 0] * rotation[j, 0]
                + turned[i, 1] * rotation[j, 1]
                + turned[i, 2] * rotation[j, 2]
                - mass * centre[i] * centre[j]
            )
        out[i, i] += mass * square

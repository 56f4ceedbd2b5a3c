"""Poses of all links, mass matrix and velocity-dependent forces of a body."""

from __future__ import annotations

from veca_marl.sim.body.anatomy import rotate_about_axis
from veca_marl.sim.body.humanoid.link_tree import LinkArrays, LinkTree
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel


@kernel
def cross_into(a: Floats, b: Floats, out: Floats) -> None:
    """Write the cross product of two vectors ``(3,)``; `out` must be another array."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def add_cross(a: Floats, b: Floats, out: Floats) -> None:
    """Add the cross product of two vectors ``(3,)`` to `out`, which must be another array."""
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]


@kernel
def multiply_into(a: Floats, b: Floats, out: Floats) -> None:
    """Write the product of two matrices ``(3, 3)``; `out` must be another array."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@kernel
def add_rotated(rotation: Floats, vector: Floats, out: Floats) -> None:
    """Add a rotated vector ``(3,)`` to `out`, which must be another array."""
    for i in range(3):
        out[i] += (
            rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]
        )


@kernel
def _momentum(mass: float, moment: Floats, inertia: Floats, motion: Floats, out: Floats) -> None:
    """Write a spatial inertia times a spatial velocity."""
    for i in range(3):
        out[i] = inertia[i, 0] * motion[0] + inertia[i, 1] * motion[1] + inertia[i, 2] * motion[2]
        out[3 + i] = mass * motion[3 + i]
    add_cross(moment, motion[3:], out[:3])
    add_cross(motion[:3], moment, out[3:])


@kernel
def write_mass_matrix(tree: LinkTree, links: LinkArrays, centre: Floats, out: Floats) -> None:
    """Write the mass matrix, stored as in `factorisation`, and the centre of mass ``(3,)``.

    Composite-rigid-body algorithm (Featherstone 2008, table 6.2). The base's rows times the
    generalised velocity are the angular momentum about the reference point and the momentum.
    """
    mass, moment, inertia = links.scratch.masses, links.scratch.moments, links.scratch.inertias
    force, unit = links.scratch.six[0], links.scratch.six[1]
    for link in range(tree.parents.shape[0]):
        mass[link] = tree.masses[link]
        for i in range(3):
            moment[link, i] = links.moments[link, i]
            for j in range(3):
                inertia[link, i, j] = links.inertias[link, i, j]
    for link in range(tree.parents.shape[0] - 1, 0, -1):
        _momentum(mass[link], moment[link], inertia[link], links.hinges[link - 1], force)
        _write_row(tree, links.hinges, link, force, out)
        parent = tree.parents[link]
        mass[parent] += mass[link]
        for i in range(3):
            moment[parent, i] += moment[link, i]
            for j in range(3):
                inertia[parent, i, j] += inertia[link, i, j]
    for i in range(6):
        unit[:] = 0.0
        unit[i] = 1.0
        _momentum(mass[0], moment[0], inertia[0], unit, force)
        for j in range(i + 1):
            out[i, j] = force[j]
    for i in range(3):
        centre[i] = moment[0, i] / mass[0]


@kernel
def _write_row(tree: LinkTree, hinges: Floats, link: int, force: Floats, out: Floats) -> None:
    """Write the row of a hinge: its force on the base, its ancestors and itself."""
    row = 5 + link
    for k in range(6):
        out[row, k] = force[k]
    for d in range(6, tree.depths[row]):
        hinge, total = tree.paths[row, d] - 6, 0.0
        for k in range(6):
            total += hinges[hinge, k] * force[k]
        out[row, d] = total


@kernel
def write_bias(tree: LinkTree, links: LinkArrays, velocity: Floats, out: Floats) -> None:
    """Write the forces ``(6 + n,)`` that keep all generalised velocities constant, without weight.

    Recursive Newton-Euler algorithm (Featherstone 2008, table 5.1):
    ``mass matrix @ acceleration + bias = generalised forces``.
    """
    count = tree.parents.shape[0]
    motion, change, force = links.scratch.motion, links.scratch.change, links.scratch.force
    change[0], momentum = 0.0, links.scratch.six[0]
    for k in range(6):
        motion[0, k] = velocity[k]
    # the base's velocity is that of a point that moves with the base
    add_cross(motion[0, 3:], motion[0, :3], change[0, 3:])
    for link in range(count):
        if link > 0:
            rate, hinge = velocity[5 + link], links.hinges[link - 1]
            parent = tree.parents[link]
            for k in range(6):
                motion[link, k] = motion[parent, k] + rate * hinge[k]
                change[link, k] = change[parent, k]
            _add_motion_cross(motion[link], hinge, rate, change[link])
        _write_force(
            tree.masses[link],
            links.moments[link],
            links.inertias[link],
            motion[link],
            change[link],
            momentum,
            force[link],
        )
    _collect(tree, links.hinges, force, out)


@kernel
def _add_motion_cross(motion: Floats, hinge: Floats, rate: float, out: Floats) -> None:
    """Add the spatial cross product of a velocity and `rate` times a hinge to `out`."""
    w, u = motion[:3], motion[3:]
    x, y, z = rate * hinge[0], rate * hinge[1], rate * hinge[2]
    p, q, r = rate * hinge[3], rate * hinge[4], rate * hinge[5]
    out[0] += w[1] * z - w[2] * y
    out[1] += w[2] * x - w[0] * z
    out[2] += w[0] * y - w[1] * x
    out[3] += w[1] * r - w[2] * q + u[1] * z - u[2] * y
    out[4] += w[2] * p - w[0] * r + u[2] * x - u[0] * z
    out[5] += w[0] * q - w[1] * p + u[0] * y - u[1] * x


@kernel
def _write_force(
    mass: float,
    moment: Floats,
    inertia: Floats,
    motion: Floats,
    change: Floats,
    momentum: Floats,
    out: Floats,
) -> None:
    """Write the force on a link: inertia times acceleration plus the change of its momentum."""
    _momentum(mass, moment, inertia, change, out)
    _momentum(mass, moment, inertia, motion, momentum)
    add_cross(motion[:3], momentum[:3], out[:3])
    add_cross(motion[3:], momentum[3:], out[:3])
    add_cross(motion[:3], momentum[3:], out[3:])


@kernel
def _collect(tree: LinkTree, hinges: Floats, force: Floats, out: Floats) -> None:
    """Project the forces of all links on the hinges and the base."""
    for link in range(tree.parents.shape[0] - 1, 0, -1):
        parent, total = tree.parents[link], 0.0
        for k in range(6):
            total += hinges[link - 1, k] * force[link, k]
            force[parent, k] += force[link, k]
        out[5 + link] = total
    for k in range(6):
        out[k] = force[0, k]


@kernel
def locate_links(tree: LinkTree, rotation: Floats, angles: Floats, links: LinkArrays) -> None:
    """Write where the links are.

    Args:
        tree: The tree of n hinges.
        rotation: ``(3, 3)`` of the base.
        angles: ``(n,)`` rad.
        links: Written.
    """
    turned, centre = links.scratch.turned, links.scratch.centre
    for i in range(3):
        links.origins[0, i] = 0.0
        for j in range(3):
            links.rotations[0, i, j] = rotation[i, j]
    for link in range(tree.parents.shape[0]):
        if link > 0:
            _place_on_parent(tree, link, angles[link - 1], links, turned)
        for i in range(3):
            centre[i] = links.origins[link, i]
        add_rotated(links.rotations[link], tree.centres[link], centre)
        for i in range(3):
            links.moments[link, i] = tree.masses[link] * centre[i]
        multiply_into(links.rotations[link], tree.inertias[link], turned)
        _write_inertia(
            turned, links.rotations[link], tree.masses[link], centre, links.inertias[link]
        )


@kernel
def _place_on_parent(
    tree: LinkTree, link: int, angle: float, links: LinkArrays, turned: Floats
) -> None:
    """Write rotation, origin and hinge of a link from those of its parent."""
    parent, hinge = tree.parents[link], links.hinges[link - 1]
    for i in range(3):
        links.origins[link, i] = links.origins[parent, i]
    add_rotated(links.rotations[parent], tree.positions[link], links.origins[link])
    rotate_about_axis(tree.rotations[link], tree.axes[link], angle, turned)
    multiply_into(links.rotations[parent], turned, links.rotations[link])
    hinge[:3] = 0.0
    add_rotated(links.rotations[link], tree.axes[link], hinge[:3])
    cross_into(links.origins[link], hinge[:3], hinge[3:])


@kernel
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

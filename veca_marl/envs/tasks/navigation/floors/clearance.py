"""Distances from points of the floor to props, as far as these obstruct a body."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.geometry import Floats, distances_to
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.props.prop_shapes import prop_geoms

_HEIGHTS_M = np.array([0.05, 0.2, 0.35, 0.5, 0.65])  # of a body of 0.78 m; lintels are above


def clearances_m(prop: Prop, points: Floats) -> Floats:
    """Return the least distance to a prop at heights of 0.05 to 0.65 m above points of the floor.

    Args:
        prop: The prop, at its present pose.
        points: ``(..., 2)`` metres.

    Returns:
        ``(...)`` metres, negative inside of the prop.
    """
    above = np.empty((*points.shape[:-1], len(_HEIGHTS_M), 3))
    above[..., :2] = points[..., None, :]
    above[..., 2] = _HEIGHTS_M
    own = (above - prop.position) @ prop.rotation
    distances = [distances_to(geom, own).min(axis=-1) for geom in prop_geoms(prop.cfg)]
    least: Floats = np.min(distances, axis=0)
    return least

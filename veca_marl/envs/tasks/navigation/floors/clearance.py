"""Distances from points of the floor to props, as far as these obstruct a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.geometry import Bools, Floats, distances_to
from veca_marl.sim.physics import StandingProp

WALKER_HEIGHTS_M = np.array([0.05, 0.2, 0.35, 0.5, 0.65])  # of a body of 0.78 m; lintels are above
_ROUNDING_M = 1e-9  # by which the distance to a circle and to a shape may differ where they touch


class Clearances:
    """Distances from points of the floor to several props, at the poses that these have now.

    Most props are too far away to matter: only those are measured by their shape of which the
    circle about them on the floor plan is near. Props that can tilt have no such circle.

    Args:
        props: The props.
        heights_m: Heights above the floor at which distances are measured, see `clearances_m`.
    """

    def __init__(self, props: Sequence[StandingProp], heights_m: Floats = WALKER_HEIGHTS_M) -> None:
        self._props, self._heights_m = list(props), heights_m
        self._centres = np.array([prop.position[:2] for prop in props]).reshape(-1, 2)
        self._radii_m = np.array([prop.reach_m if prop.fixed else np.inf for prop in props])

    def all_at_least(self, points: Floats, clear_m: float) -> bool:
        """Return whether some points are at a least distance from all props.

        Args:
            points: ``(2,)`` or ``(n, 2)`` metres.
            clear_m: The distance, see `clearances_m`.
        """
        near = self._may_be_nearer(points.reshape(-1, 2), clear_m + _ROUNDING_M)
        return all(
            bool((clearances_m(self._props[number], points, self._heights_m) >= clear_m).all())
            for number in np.flatnonzero(near).tolist()
        )

    def _may_be_nearer(self, points: Floats, distance_m: float) -> Bools:
        """Return which of the circles about the props are nearer than a distance to a point."""
        offsets = points[:, None] - self._centres
        gaps_m = np.hypot(offsets[..., 0], offsets[..., 1]) - self._radii_m
        nearer: Bools = (gaps_m < distance_m).any(axis=0)
        return nearer


def clearances_m(
    prop: StandingProp, points: Floats, heights_m: Floats = WALKER_HEIGHTS_M
) -> Floats:
    """Return the least distance to a prop at some heights above points of the floor.

    Args:
        prop: The prop, at its present pose.
        points: ``(..., 2)`` metres.
        heights_m: The heights, ``(n,)`` metres; 0.05 to 0.65 m if they are not given.

    Returns:
        ``(...)`` metres, negative inside of the prop.
    """
    above = np.empty((*points.shape[:-1], len(heights_m), 3))
    above[..., :2] = points[..., None, :]
    above[..., 2] = heights_m
    own = (above - prop.position) @ prop.rotation
    distances = [distances_to(geom, own).min(axis=-1) for geom in prop.geoms]
    least: Floats = np.min(distances, axis=0)
    return least

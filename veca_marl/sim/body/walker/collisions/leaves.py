"""Doors, drawers and lids that a walker pushes while they can move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, pybullet
from veca_marl.sim.physics.props.prop_shapes import swept_radius_m


class Leaves:
    """Props with a joint, and which of them a walker can reach within an agent step.

    A leaf moves within a circle about the anchor of its joint, at any opening and speed. The anchor
    is read from Bullet, because props can be placed elsewhere.

    Args:
        client: The PyBullet client.
        props: Props with a joint.
    """

    def __init__(self, client: int, props: Sequence[Prop]) -> None:
        self._client = client
        self._swept_m = [
            (prop, swept_radius_m(prop.geoms, prop.cfg.joint))
            for prop in props
            if prop.cfg.joint is not None
        ]

    def near(self, position: Floats, reach_m: float) -> list[Prop]:
        """Return the leaves that may come within a distance of a point.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: The horizontal distance.
        """
        return [
            prop
            for prop, swept_m in self._swept_m
            if horizontal_distance(self._anchor(prop), position) < swept_m + reach_m
        ]

    def _anchor(self, prop: Prop) -> Floats:
        """Return the anchor of a joint, ``(3,)`` metres: the base of the body in Bullet."""
        anchor, _ = pybullet.getBasePositionAndOrientation(
            prop.body_id, physicsClientId=self._client
        )
        return np.array(anchor)

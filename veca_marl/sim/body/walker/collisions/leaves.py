"""Doors, drawers and lids that a walker pushes while they can move."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.props.geoms import swept_radius_m
from veca_marl.sim.physics.props.joint import Joint


class Leaves:
    """Props with a joint, and which of them a walker can reach within an agent step.

    A leaf moves within a circle about the anchor of its joint, at any opening and speed.

    Args:
        props: Props with a joint.
    """

    def __init__(self, props: Sequence[Prop]) -> None:
        self._leaves: list[tuple[Prop, Joint, float]] = [
            (prop, prop.joint, swept_radius_m(prop.geoms, prop.joint.cfg))
            for prop in props
            if prop.joint is not None
        ]

    def near(self, position: Floats, reach_m: float) -> list[Prop]:
        """Return the leaves that may come within a distance of a point.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: The horizontal distance.
        """
        return [
            prop
            for prop, joint, swept_m in self._leaves
            if horizontal_distance(joint.anchor, position) < swept_m + reach_m
        ]

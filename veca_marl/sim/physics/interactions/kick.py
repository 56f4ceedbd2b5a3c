"""Kicks by choice, beside the automatic ones of KickTheBall and soccer."""

from __future__ import annotations

from typing import ClassVar

from veca_marl.sim.physics.interactions.foot import FootInteraction
from veca_marl.sim.physics.interactions.interaction import InteractingBody
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop


@register_interaction
class Kick(FootInteraction):
    """Kick a light prop that is ahead and within reach of the foot, see `Walker.can_kick`."""

    name: ClassVar[str] = "kick"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the foot reaches the prop."""
        return body.can_kick(prop)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Give the prop the velocity of a kick."""
        body.kick(prop)

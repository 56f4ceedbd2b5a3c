"""Pressing a prop, such as a button or a toy car: its effect is up to the task."""

from __future__ import annotations

from typing import ClassVar

from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop


@register_interaction
class Press(Interaction):
    """Press a prop. It moves nothing: a task reads `Walker.applied_verb` after the step."""

    name: ClassVar[str] = "press"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return True: every interactable prop that declares it can be pressed."""
        return True

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Change nothing in the world."""

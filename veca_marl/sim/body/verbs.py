"""Taking a prop into the hand, and releasing it."""

from __future__ import annotations

from typing import ClassVar

from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop


@register_interaction
class Grab(Interaction):
    """Take a light prop into the empty hand, unless another body holds it."""

    name: ClassVar[str] = "grab"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the hand is empty and the prop is light and no other body holds it."""
        return body.can_grab(prop)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Hold the prop: from now on it follows the hand."""
        body.grab(prop)


@register_interaction
class Release(Interaction):
    """Release the held prop, which falls. Every held prop can be released."""

    name: ClassVar[str] = "release"

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the held prop."""
        return body.held

    def declared_by(self, prop: Prop) -> bool:
        """Return True: a prop that can be grabbed can be released."""
        return True

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the body holds the prop."""
        return body.held is prop

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Open the hand."""
        body.release()

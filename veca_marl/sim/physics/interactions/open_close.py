"""Opening and closing doors, drawers and lids; keys."""

from __future__ import annotations

from typing import ClassVar

from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop

_END = 0.99  # an opening from which a joint counts as open


@register_interaction
class Open(Interaction):
    """Let the motor of a joint open it; what is locked needs its key in the hand.

    The key stays in the hand, and the joint unlocked.
    """

    name: ClassVar[str] = "open"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the joint is not open, and not locked or its key is held."""
        if prop.joint is None or prop.opening > _END:
            return False
        return not prop.locked or (body.held is not None and prop.takes(body.held))

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Unlock it if it is locked, and start the motor."""
        if prop.locked and body.held is not None:
            prop.unlock(body.held)
        prop.open()


@register_interaction
class Close(Interaction):
    """Let the motor of a joint close it."""

    name: ClassVar[str] = "close"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the joint is neither closed nor locked."""
        return prop.joint is not None and not prop.locked and prop.opening > 1.0 - _END

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Start the motor."""
        prop.close()

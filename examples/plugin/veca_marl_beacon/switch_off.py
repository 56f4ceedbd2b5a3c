"""The verb `switch_off`: silence a prop that emits a sound."""

from __future__ import annotations

from veca_marl.extend import InteractingBody, Interaction, Prop, register_interaction


@register_interaction
class SwitchOff(Interaction):
    """Mute the sound of a prop until the next episode."""

    name = "switch_off"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the prop emits a sound."""
        return prop.sound is not None and not prop.sound.muted

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Mute it; a reset of the world restores it."""
        if prop.sound is not None:
            prop.sound.muted = True

"""The `voice` part of a body's action: one of the calls, or none."""

from __future__ import annotations

from enum import Enum

from veca_marl.sim.sound import Call
from veca_marl.sim.spec import ArraySpec, discrete_spec

VOICE = "voice"  # the part's name


class VoiceKind(Enum):
    """Whether a body's action has a part `voice`. `make_sound` works with either."""

    silent = "silent"
    calls = "calls"


def voice_spec(kind: VoiceKind) -> dict[str, ArraySpec]:
    """Return the part of the action that chooses a call; empty for a body that has none."""
    if kind is VoiceKind.silent:
        return {}
    return {VOICE: discrete_spec(tuple(call.name for call in Call))}

"""The parameters that all bodies have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from veca_marl.sim.body.voice import VoiceKind


@dataclass
class BodyCfg:
    """Parameters that all bodies have.

    Attributes:
        eye_range_deg: Largest rotation of the eyes in the head, to each side and up and down, below
            90.
        voice: Whether the action has a part `voice` that chooses a call.
        call_pause_s: Silence after each call, at most 60 s. No other call can begin meanwhile, and
            other sounds of the mouth wait.
        interaction_range_m: Objects can be interacted with if their distance from the head is
            smaller. The paper's main text has 1.5 m, its table of functions 2.5 m.
    """

    # fields that were added later, with the value that bodies had before
    formerly: ClassVar[dict[str, Any]] = {"call_pause_s": 0.0}

    eye_range_deg: float = 50.0
    voice: VoiceKind = VoiceKind.silent
    call_pause_s: float = 0.0
    interaction_range_m: float = 1.5

    def __post_init__(self) -> None:
        """Check that all numbers are finite and not negative."""
        self._check_choices(voice=VoiceKind)
        for name, value in vars(self).items():
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"body.{name}={value} must be a finite number, 0 or more")
        if self.eye_range_deg >= 90.0:
            raise ValueError(f"body.eye_range_deg={self.eye_range_deg} must be below 90")
        if self.call_pause_s > 60.0:
            raise ValueError(f"body.call_pause_s={self.call_pause_s} must be at most 60")

    def _check_choices(self, **kinds: type[Enum]) -> None:
        """Raise `ValueError` for a field that is no member of its enumeration."""
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                choices = [choice.name for choice in kind]
                raise ValueError(f"body.{name}={getattr(self, name)!r}; there are {choices}")

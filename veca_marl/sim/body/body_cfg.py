"""Parameters that all bodies have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.body.action import VoiceKind
from veca_marl.sim.body.anatomy import REFERENCE, Growth, growth_at, growth_of_height


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
            smaller. The paper's main text has 1.5 m, its table of functions 2.5 m. It is in
            proportion to the height of the body: this is for one of 0.78 m.
        age_months: Size of a child of this age, from 1 to 36; see `Growth`. None is the body of
            0.78 m. All lengths, speeds and masses of a configuration are for that body, and those
            of another size are in proportion.
        height_m: Standing height, in place of an age: the size of the age at which it is the
            median, from 0.5415 to 0.9557.
    """

    eye_range_deg: float = 50.0
    voice: VoiceKind = VoiceKind.silent
    call_pause_s: float = 0.0
    interaction_range_m: float = 1.5
    age_months: float | None = None
    height_m: float | None = None

    def __post_init__(self) -> None:
        """Check that all numbers are finite and not negative, and the size."""
        self._check_choices(voice=VoiceKind)
        for name, value in vars(self).items():
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"body.{name}={value} must be a finite number, 0 or more")
        if self.eye_range_deg >= 90.0:
            raise ValueError(f"body.eye_range_deg={self.eye_range_deg} must be below 90")
        if self.call_pause_s > 60.0:
            raise ValueError(f"body.call_pause_s={self.call_pause_s} must be at most 60")
        _ = self.growth

    @property
    def growth(self) -> Growth:
        """The size of the body.

        Raises:
            ValueError: If both age and height are given, or one is outside the tables.
        """
        if self.age_months is not None and self.height_m is not None:
            raise ValueError(
                f"body.age_months={self.age_months} and body.height_m={self.height_m}: "
                "give one of them"
            )
        if self.age_months is not None:
            return growth_at(self.age_months)
        return REFERENCE if self.height_m is None else growth_of_height(self.height_m)

    def _check_choices(self, **kinds: type[Enum]) -> None:
        """Raise `ValueError` for a field that is no member of its enumeration."""
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                choices = [choice.name for choice in kind]
                raise ValueError(f"body.{name}={getattr(self, name)!r}; there are {choices}")

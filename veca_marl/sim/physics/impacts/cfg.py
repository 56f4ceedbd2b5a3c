"""Sounds of impacts as data."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class ImpactCfg:
    """Sounds of impacts.

    Attributes:
        present: Whether things that hit each other or the floor, and steps of walkers, are heard.
        gain_per_ns: Sound pressure at 1 m per newton second of impulse.
        min_speed_mps: Change of speed in one physics step, and landing speed of a foot, below which
            a contact is silent: that of the lighter thing by the impulse of the contact, and that
            of one of both by everything.
    """

    present: bool = False
    gain_per_ns: float = 0.2
    min_speed_mps: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("gain_per_ns", "min_speed_mps"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"impacts.{name}={value} must be positive and finite")

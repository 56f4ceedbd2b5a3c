"""Sounds of impacts as data."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class ImpactCfg:
    """Sounds of impacts.

    Attributes:
        present: Whether things that hit each other or the floor, doors and drawers that meet the
            end of their range, and steps of walkers are heard.
        gain_per_ns: Sound pressure at 1 m per newton second of impulse.
        min_speed_mps: Least change of speed in one physics step that is heard, beside that by
            gravity, and least landing speed of a foot. A contact is silent if its impulse would
            change the speed of the lighter thing by less, or if neither thing changes by more. The
            stop of a joint is silent below that speed of the farthest point of the prop.
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

"""How long a run trains, and where it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class Budget:
    """How long to train.

    Attributes:
        total_frames: Frames of experience (rounded up to whole batches).
        max_minutes: Also stop after the stage in which this time runs out, which begins anew when a
            run is resumed; None for no limit.
    """

    total_frames: int
    max_minutes: float | None = None

    def is_spent(self, elapsed_s: float) -> bool:
        """Return whether the time has run out."""
        return self.max_minutes is not None and elapsed_s > 60.0 * self.max_minutes


@dataclass
class Progress:
    """Where a run stands; stored in its checkpoints.

    Attributes:
        stage: Finished stages.
        iteration: Finished batches.
        frames: Frames learnt from.
        best_return: Best mean return of the evaluations, where one team learns.
    """

    stage: int = 0
    iteration: int = 0
    frames: int = 0
    best_return: float = -math.inf

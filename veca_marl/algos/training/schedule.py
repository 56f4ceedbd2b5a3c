"""Batches and stages of a training run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Schedule:
    """The numbers of batches of a run and of its stages; the last stage may have fewer.

    Attributes:
        batches: Batches of the run, at least 1.
        batches_per_stage: Batches between two evaluations, at least 1.
        frames_per_batch: Frames of a batch, at least 1.
    """

    batches: int
    batches_per_stage: int
    frames_per_batch: int

    @classmethod
    def of(cls, total_frames: int, frames_per_stage: int, frames_per_batch: int) -> Schedule:
        """Return the schedule of at least `total_frames`; stages are rounded up to whole batches.

        Args:
            total_frames: Frames of the run.
            frames_per_stage: Frames between two evaluations.
            frames_per_batch: Frames of a batch.
        """
        return cls(
            math.ceil(total_frames / frames_per_batch),
            math.ceil(frames_per_stage / frames_per_batch),
            frames_per_batch,
        )

    @property
    def frames(self) -> int:
        """Frames of the run."""
        return self.batches * self.frames_per_batch

    def stages_after(self, batches: int) -> Iterator[int]:
        """Yield the number of batches of each stage that follows a number of finished batches."""
        for start in range(batches, self.batches, self.batches_per_stage):
            yield min(self.batches_per_stage, self.batches - start)

"""Short training runs for a digest."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

import veca_marl
from tools.digests.hashing import Digest

FRAMES = 512
SHORT = (
    "collect=one_process",
    "collect.worlds=4",
    "collect.steps=32",
    "eval.every_frames=256",
    "eval.episodes=2",
    "eval.worlds=2",
    "task.max_seconds=0.8",
    "log=silent",
    "threads=1",
    "device=cpu",
)
"""Batches of 128 frames, two stages, episodes that end within a batch."""


@dataclass(frozen=True)
class Training:
    """A run of `FRAMES` frames.

    Attributes:
        name: Its name.
        task: What is learnt.
        overrides: Other choices than `SHORT`.
    """

    name: str
    task: str
    overrides: tuple[str, ...] = ()

    def measure(self, digest: Digest) -> None:
        """Add the state of the last checkpoint and all rows of metrics and evaluations.

        The state has the parameters of all networks, of the optimisers and of intrinsic rewards.
        """
        with tempfile.TemporaryDirectory() as folder:
            run = Path(folder) / "run"
            result = veca_marl.train(
                self.task, total_frames=FRAMES, folder=run, overrides=[*SHORT, *self.overrides]
            )
            digest.add("state", last_state(run))
        digest.add("metrics", without_times(result.metrics))
        digest.add("evaluations", without_times(result.evaluations))
        digest.add("comparison", result.comparison)


def last_state(run: Path) -> Mapping[str, Any]:
    """Return what the last checkpoint of a run holds beside its configuration.

    Raises:
        FileNotFoundError: If there is no checkpoint.
    """
    checkpoints = sorted((run / "checkpoints").glob("frames_*.pt"))
    if not checkpoints:
        raise FileNotFoundError(f"{run} has no checkpoint")
    state: Mapping[str, Any] = torch.load(checkpoints[-1], weights_only=True)["state"]
    return state


def without_times(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return rows without the columns that depend on the clock, whose names end in ``_s``."""
    return [{k: v for k, v in row.items() if not k.endswith("_s")} for row in rows]

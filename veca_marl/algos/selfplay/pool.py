"""Past policies, stored as files."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.training.checkpoint import CheckpointError


class Pool:
    """Past policies in a folder: the actor of a team after so many frames.

    Args:
        folder: The folder, created with the first policy.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def store(self, team: str, frames: int, actor: dict[str, Any]) -> None:
        """Write the state of an actor.

        Raises:
            CheckpointError: If it cannot be written.
        """
        path = self._path(team, frames)
        content = io.BytesIO()
        torch.save(actor, content)
        temporary = path.with_suffix(".tmp")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(content.getbuffer())
            os.replace(temporary, path)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise CheckpointError(f"cannot write {path}: {error}") from error

    def members(self, team: str, until: int | None = None) -> list[int]:
        """Return the frames after which policies of a team were stored, in ascending order.

        Args:
            team: Name of the team.
            until: Leave out later ones: an interrupted run may have been further.
        """
        found = (int(path.stem.rpartition("_")[2]) for path in self.folder.glob(f"{team}_*.pt"))
        return sorted(frames for frames in found if until is None or frames <= until)

    def load(self, team: str, frames: int) -> dict[str, Any]:
        """Return the state of an actor."""
        state: dict[str, Any] = torch.load(self._path(team, frames), weights_only=True)
        return state

    def _path(self, team: str, frames: int) -> Path:
        return self.folder / f"{team}_{frames:012d}.pt"

"""Past policies, stored as files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import torch
from torch import nn

from veca_marl.algos.checkpoints.checkpoint_file import (
    CheckpointError,
    load_errors,
    load_file,
)
from veca_marl.algos.files import WriteError, write_atomically

_DIGITS = 12  # of the frames in the name of a file


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
        content = io.BytesIO()
        torch.save(actor, content)
        try:
            write_atomically(self._path(team, frames), content.getbuffer())
        except WriteError as error:
            raise CheckpointError(str(error)) from error

    def members(self, team: str, until: int | None = None) -> list[int]:
        """Return the frames after which policies of a team were stored, in ascending order.

        Args:
            team: Name of the team.
            until: Leave out later ones: an interrupted run may have been further.
        """
        files = self.folder.glob(f"{team}_{'[0-9]' * _DIGITS}.pt")
        found = (int(path.stem.rpartition("_")[2]) for path in files)
        return sorted(frames for frames in found if until is None or frames <= until)

    def load_into(self, actor: nn.Module, team: str, frames: int) -> None:
        """Load the state of a past policy into an actor.

        Raises:
            CheckpointError: If the file cannot be read, or holds another network.
        """
        path = self._path(team, frames)
        state = load_file(path, torch.device("cpu"))
        with load_errors(path):
            actor.load_state_dict(state)

    def _path(self, team: str, frames: int) -> Path:
        return self.folder / f"{team}_{frames:0{_DIGITS}d}.pt"

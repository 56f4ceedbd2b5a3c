"""Checkpoints: written atomically, the last few and the best, bound to task and specs."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.checkpoints.checkpoint_file import FORMAT, CheckpointError, read_checkpoint
from veca_marl.algos.checkpoints.delayed_signals import interrupts_wait
from veca_marl.algos.checkpoints.identity import Identity, check_config, check_identity
from veca_marl.algos.files import WriteError, write_atomically


class Checkpoints:
    """The checkpoints of one run.

    Each file holds the format, the identity, the configuration of the run, the numbers of each
    team's algorithm, and under ``state`` what `save` was given.

    Args:
        folder: Where they are; created at the first save. None keeps nothing.
        identity: What they belong to.
        config: The run's configuration as plain data.
        keep_last: Number of the latest that are kept, beside the best one.
        may_change: Keys of `config` in which a checkpoint that is loaded may differ from it.
        by_team: Keys of `config` that are mappings from the names of teams.
    """

    def __init__(
        self,
        folder: Path | None,
        identity: Identity,
        config: dict[str, Any],
        keep_last: int = 3,
        may_change: Collection[str] = (),
        by_team: Collection[str] = (),
    ) -> None:
        self.folder, self.identity, self.config = folder, identity, config
        self.keep_last, self.may_change, self.by_team = keep_last, may_change, by_team

    def save(
        self,
        state: dict[str, Any],
        frames: int,
        best: bool,
        algorithms: Mapping[str, Any] | None = None,
    ) -> Path | None:
        """Write `state`, then remove checkpoints that are too old.

        Args:
            state: Tensors and plain data.
            frames: Training frames so far: the file's name.
            best: Whether it is the best so far.
            algorithms: Team to the numbers of its algorithm as plain data.

        Returns:
            The file; None without a folder.

        Raises:
            CheckpointError: If it cannot be written; earlier checkpoints are unchanged.
        """
        if self.folder is None:
            return None
        path = self.folder / f"frames_{frames:012d}.pt"
        content = {
            "format": FORMAT,
            "identity": self.identity.to_dict(),
            "config": self.config,
            "algorithms": dict(algorithms or {}),
            "state": state,
        }
        with interrupts_wait():
            file = io.BytesIO()
            torch.save(content, file)
            if best:  # first: a run that is killed in between writes both again
                self._write(file.getbuffer(), self.folder / "best.pt")
            self._write(file.getbuffer(), path)
        self.remove_old()
        return path

    def load(self, path: Path, device: torch.device) -> dict[str, Any]:
        """Return the state in one of the checkpoints, from which the run is to continue.

        Raises:
            CheckpointError: If it cannot be read, or belongs to another task, other specs or
                another configuration.
        """
        try:
            content = read_checkpoint(path, device)
        except CheckpointError as error:
            earlier = [file for file in self._files() if file < path]
            if not earlier:
                raise
            raise CheckpointError(
                f"{error}; remove it to continue from {earlier[-1].name}"
            ) from error
        check_identity(path, content["identity"], self.identity.to_dict())
        check_config(path, content["config"], self.config, self.may_change, self.by_team)
        state: dict[str, Any] = content["state"]
        return state

    @property
    def empty(self) -> bool:
        """Whether there is no checkpoint."""
        return not self._files()

    def remove_old(self) -> None:
        """Remove checkpoints that are too old, and temporary files of killed processes."""
        for old in self._files()[: -self.keep_last]:
            old.unlink()
        if self.folder is not None:
            for unfinished in self.folder.glob(".*.tmp"):
                unfinished.unlink()

    def latest(self) -> Path:
        """Return the newest checkpoint.

        Raises:
            CheckpointError: If there is none.
        """
        files = self._files()
        if not files:
            raise CheckpointError(f"no checkpoint in {self.folder}")
        return files[-1]

    def _files(self) -> list[Path]:
        return [] if self.folder is None else sorted(self.folder.glob("frames_*.pt"))

    def _write(self, content: memoryview, path: Path) -> None:
        try:
            write_atomically(path, content)
        except WriteError as error:
            kept = self._files()
            last = kept[-1] if kept else "none"
            raise CheckpointError(f"{error}; the last intact checkpoint is {last}") from error

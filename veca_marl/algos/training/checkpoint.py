"""Checkpoints: written atomically, the last few and the best, bound to task and specs."""

from __future__ import annotations

import io
import os
import pickle
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.specs import TeamSpec

# 3: actions have named parts, and each team an algorithm of its own
_FORMAT = 3
_CPU = torch.device("cpu")


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written, read, or used here."""


@dataclass(frozen=True)
class Identity:
    """What a checkpoint belongs to.

    Attributes:
        task: Name of the task.
        specs: Team name to its arrays.
    """

    task: str
    specs: dict[str, TeamSpec]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"task": self.task, "specs": {t: s.to_dict() for t, s in self.specs.items()}}


class Checkpoints:
    """The checkpoints of one run.

    Each file holds the format, the identity, the configuration of the run, the numbers of each
    team's algorithm, and under ``state`` what `save` was given.

    Args:
        folder: Where they are; created at the first save. None keeps nothing.
        identity: What they belong to.
        config: The run's configuration as plain data, for the reader.
        keep_last: Number of the latest that are kept, beside the best one.
    """

    def __init__(
        self, folder: Path | None, identity: Identity, config: dict[str, Any], keep_last: int = 3
    ) -> None:
        self.folder, self.identity, self.config = folder, identity, config
        self.keep_last = keep_last

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
            "format": _FORMAT,
            "identity": self.identity.to_dict(),
            "config": self.config,
            "algorithms": dict(algorithms or {}),
            "state": state,
        }
        with _interrupts_wait():
            file = io.BytesIO()
            torch.save(content, file)
            self._write(file.getbuffer(), path)
            if best:
                self._write(file.getbuffer(), self.folder / "best.pt")
        for old in self._files()[: -self.keep_last]:
            old.unlink()
        return path

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
        temporary = path.with_suffix(".tmp")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with temporary.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            kept = self._files()
            raise CheckpointError(
                f"cannot write {path}: {error}; "
                f"the last intact checkpoint is {kept[-1] if kept else 'none'}"
            ) from error


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Delay Ctrl-C until the block is done; inside it torch would raise another error."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    received: list[int] = []
    previous = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
    if received:
        signal.raise_signal(received[0])


def load_checkpoint(path: Path, identity: Identity, device: torch.device) -> dict[str, Any]:
    """Return the state that `Checkpoints.save` was given.

    Raises:
        CheckpointError: If the file cannot be read, or belongs to another task or other specs.
    """
    content = read_checkpoint(path, device)
    _check_identity(path, content["identity"], identity.to_dict())
    state: dict[str, Any] = content["state"]
    return state


def read_checkpoint(path: Path, device: torch.device = _CPU) -> dict[str, Any]:
    """Return everything that is in the file of a checkpoint.

    Raises:
        CheckpointError: If it cannot be read, or is not a checkpoint of this version.
    """
    try:
        content = torch.load(path, map_location=device, weights_only=True)
    except (OSError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise CheckpointError(f"cannot read the checkpoint {path}: {error}") from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise CheckpointError(f"{path} is not a checkpoint of this version (format {_FORMAT})")
    return content


def _check_identity(path: Path, stored: dict[str, Any], wanted: dict[str, Any]) -> None:
    if stored["task"] != wanted["task"]:
        raise CheckpointError(f"{path} is of task {stored['task']}, wanted: {wanted['task']}")
    differing = [
        f"{name}: {ours} in the checkpoint, {theirs} here"
        for name, ours, theirs in _differences(stored["specs"], wanted["specs"])
    ]
    if differing:
        raise CheckpointError(f"{path} was made for other specs: {'; '.join(differing)}")


def spec_differences(stored: dict[str, Any], spec: TeamSpec) -> str:
    """Return how a stored specification differs from `spec`; empty if it does not."""
    return "; ".join(
        f"{name}: {there} there, {here} here"
        for name, there, here in _differences(stored, spec.to_dict())
    )


def _differences(one: Any, other: Any, name: str = "") -> list[tuple[str, Any, Any]]:
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            found
            for key in sorted({*one, *other})
            for found in _differences(
                one.get(key, "absent"), other.get(key, "absent"), f"{name}.{key}".lstrip(".")
            )
        ]
    return [] if one == other else [(name, one, other)]

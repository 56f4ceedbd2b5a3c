"""Checkpoints: written whole or not at all, the last few and the best, bound to their task."""

from __future__ import annotations

import io
import os
import pickle
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.specs import TeamSpec

# 3: actions are named parts; an older state does not say which
_FORMAT = 3


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

    Args:
        folder: Where they lie; made at the first save.
        identity: What they belong to.
        config: The run's configuration as plain data, stored beside every state.
        keep_last: How many of the latest stay; the best always stays.
    """

    def __init__(
        self, folder: Path, identity: Identity, config: dict[str, Any], keep_last: int = 3
    ) -> None:
        self.folder, self.identity, self.config = folder, identity, config
        self.keep_last = keep_last

    def save(self, state: dict[str, Any], frames: int, best: bool) -> Path:
        """Write `state`, then remove what is too old.

        Args:
            state: Tensors and plain data.
            frames: Training frames so far: the file's name.
            best: Whether it is the best so far.

        Raises:
            CheckpointError: If it cannot be written; earlier checkpoints are as they were.
        """
        path = self.folder / f"frames_{frames:012d}.pt"
        content = {
            "format": _FORMAT,
            "identity": self.identity.to_dict(),
            "config": self.config,
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
        return sorted(self.folder.glob("frames_*.pt"))

    def _write(self, content: memoryview, path: Path) -> None:
        temporary = path.with_suffix(".tmp")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
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
    """Let Ctrl-C wait until the block is done; torch would make an error of its own of it."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread hears it
        return
    heard: list[int] = []
    previous = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
    if heard:
        signal.raise_signal(heard[0])


def load_checkpoint(path: Path, identity: Identity, device: torch.device) -> dict[str, Any]:
    """Return the state that `Checkpoints.save` was given.

    Raises:
        CheckpointError: If the file cannot be read, or belongs to another task or other specs.
    """
    try:
        content = torch.load(path, map_location=device, weights_only=True)
    except (OSError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise CheckpointError(f"cannot read the checkpoint {path}: {error}") from error
    _check_identity(path, check_format(path, content)["identity"], identity.to_dict())
    state: dict[str, Any] = content["state"]
    return state


def check_format(path: Path, content: Any) -> dict[str, Any]:
    """Return what was read from a file, if it is a checkpoint that means here what it meant then.

    Raises:
        CheckpointError: If it is not.
    """
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

"""Reading the file of a checkpoint: what is damaged or of another version is refused."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

# 3: actions have named parts, and each team an algorithm of its own
FORMAT = 3
_KEYS = {"identity", "config", "algorithms", "state"}
_CPU = torch.device("cpu")
# what torch.load raises for files that are cut off or have other content
_UNREADABLE = (RuntimeError, EOFError, pickle.UnpicklingError, ValueError, KeyError, TypeError)


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written, read, or used here."""


def read_checkpoint(path: Path, device: torch.device) -> dict[str, Any]:
    """Return everything that is in the file of a checkpoint.

    Raises:
        CheckpointError: If it cannot be read, or is not a checkpoint of this version.
    """
    return _checked(path, load_file(path, device))


def map_checkpoint(path: Path) -> dict[str, Any]:
    """Return what `read_checkpoint` returns; of its tensors, the disk is read when they are used.

    A replay buffer in a checkpoint thus takes neither memory nor time where only a network is
    wanted. The file has to stay as it is until the tensors have been copied.

    Raises:
        CheckpointError: See `read_checkpoint`.
    """
    return _checked(path, _load(path, map_location=_CPU, mmap=True))


def _checked(path: Path, content: Any) -> dict[str, Any]:
    """Return the content of a file if it is a checkpoint of this version."""
    if not isinstance(content, dict) or "format" not in content:
        raise CheckpointError(f"{path} is not a checkpoint of a run")
    if content["format"] != FORMAT:
        raise CheckpointError(
            f"{path} has format {content['format']}, this version reads format {FORMAT}"
        )
    missing = sorted(_KEYS - set(content))
    if missing:
        raise CheckpointError(f"{path} is incomplete: no {', '.join(missing)}")
    checked: dict[str, Any] = content
    return checked


def load_file(path: Path, device: torch.device) -> Any:
    """Return the tensors and plain data in a file that `torch.save` wrote.

    Raises:
        CheckpointError: If it cannot be read.
    """
    return _load(path, map_location=device)


def _load(path: Path, **options: Any) -> Any:
    try:
        return torch.load(path, weights_only=True, **options)
    except FileNotFoundError as error:
        raise CheckpointError(f"{path} does not exist") from error
    except (OSError, *_UNREADABLE) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise CheckpointError(f"cannot read {path} (cut off or no checkpoint): {reason}") from error


@contextmanager
def load_errors(path: Path) -> Iterator[None]:
    """Raise `CheckpointError` where a state that is loaded inside the block does not fit."""
    try:
        yield
    except (RuntimeError, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise CheckpointError(f"{path} does not fit: {type(error).__name__}: {reason}") from error

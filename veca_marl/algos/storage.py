"""Memory and disk space that learning will take: checked before a run begins, then reserved.

Runs that begin at the same time find the same memory available. Each reserves what it has stated
when its buffers are made, so that one for which it is not enough ends then, and not hours later,
when the buffers have filled.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from torch import Tensor

from veca_marl.algos.files import WriteError, write_errors
from veca_marl.algos.memory import available_memory
from veca_marl.algos.specs import TeamSpec

_SHARE = 0.9  # of what is available; the rest is left to networks, worlds and other programs
_CHUNK = 64 * 2**20  # bytes; between two chunks the memory that is left is read again


class StorageError(WriteError):
    """A buffer does not fit into the memory that is left."""


@dataclass(frozen=True)
class StorageNeeded:
    """What an algorithm stores beside its parameters.

    Attributes:
        memory_bytes: Bytes of memory.
        disk_bytes: Bytes in `folder`.
        folder: Folder on the disk.
        settings: Fields of the configuration that change it, for error messages.
    """

    memory_bytes: int = 0
    disk_bytes: int = 0
    folder: Path | None = None
    settings: str = ""


def check_storage(needed: Mapping[str, StorageNeeded]) -> list[str]:
    """Check that what all teams need is available together.

    Args:
        needed: Team to what its algorithm needs.

    Returns:
        A line for each kind of storage that is needed.

    Raises:
        ValueError: If it does not fit, or a folder cannot be used; the message says what to change.
    """
    settings = next((need.settings for need in needed.values() if need.settings), "")
    lines = []
    memory = sum(need.memory_bytes for need in needed.values())
    if memory:
        lines.append(_check("memory", memory, available_memory(), settings))
    for folders in _folders_by_disk([needed]):
        on_disk = [need for need in needed.values() if need.folder in folders]
        settings = on_disk[0].settings
        for folder in folders:
            _check_folder(folder, settings)
        disk, free = sum(need.disk_bytes for need in on_disk), available_disk(folders[0])
        names = " and ".join(map(str, folders))
        lines.append(_check(f"disk space in {names}", disk, free, settings))
    return lines


def runs_that_fit(needs: Sequence[Mapping[str, StorageNeeded]]) -> int:
    """Return the largest number of runs of which any so many fit at the same time.

    Args:
        needs: For each run what its teams need, see `check_storage`.
    """
    memory = available_memory()
    sizes = [sum(need.memory_bytes for need in run.values()) for run in needs]
    numbers = [len(needs)] if memory is None else [_any_fit(sizes, memory)]
    for folders in _folders_by_disk(needs):
        taken = [
            sum(need.disk_bytes for need in run.values() if need.folder in folders) for run in needs
        ]
        numbers.append(_any_fit(taken, available_disk(folders[0])))
    return min(numbers)


def _folders_by_disk(needs: Iterable[Mapping[str, StorageNeeded]]) -> list[list[Path]]:
    """Return the folders in which something is stored, those on one disk together."""
    disks: dict[int, list[Path]] = {}
    for folder in sorted({n.folder for run in needs for n in run.values() if n.folder is not None}):
        disks.setdefault(_existing(folder).stat().st_dev, []).append(folder)
    return list(disks.values())


def _any_fit(sizes: Sequence[int], available: int) -> int:
    """Return how many of the largest sizes fit together: any other choice of so many does too."""
    return sum(total <= _SHARE * available for total in accumulate(sorted(sizes, reverse=True)))


def _check_folder(folder: Path, settings: str) -> None:
    """Check that files can be made in a folder, or that it can be made where it is to be."""
    try:
        with TemporaryDirectory(dir=_existing(folder)):
            pass
    except OSError as error:
        raise ValueError(
            f"the replay buffers cannot be stored in {folder}: {error.strerror} "
            f"({error.filename}); change {settings}"
        ) from error


def _check(kind: str, needed: int, available: int | None, settings: str) -> str:
    if available is None:
        return f"replay: {_size(needed)} of {kind}"
    if needed > _SHARE * available:
        raise ValueError(
            f"the replay buffers take {_size(needed)} of {kind}, and {_size(available)} are "
            f"available, of which {_SHARE:.0%} may be used; change {settings}"
        )
    return f"replay: {_size(needed)} of {kind}, {_size(available)} are available"


def _size(number: int) -> str:
    return f"{number / 1e9:.2f} GB"


def available_disk(folder: Path) -> int:
    """Return the free bytes of the disk on which `folder` is, or will be."""
    return shutil.disk_usage(_existing(folder)).free


def _existing(folder: Path) -> Path:
    """Return the folder, or the nearest one above it that exists."""
    return next(path for path in (folder, *folder.absolute().parents) if path.exists())


def reserve_memory(arrays: Sequence[Tensor], settings: str) -> None:
    """Fill new arrays with zeros: the system assigns memory to an array when it is written to.

    Args:
        arrays: The arrays.
        settings: Fields of the configuration that change their size, for the error message.

    Raises:
        StorageError: If the memory that is left is less than what is not filled yet.
    """
    left = sum(array.nbytes for array in arrays)
    for array in arrays:
        row = array.nbytes // len(array)
        for rows in array.split(max(1, _CHUNK // max(row, 1))):
            _check_rest(left, settings)
            rows.zero_()
            left -= rows.nbytes


def _check_rest(needed: int, settings: str) -> None:
    available = available_memory()
    if available is not None and needed > available:
        raise StorageError(
            f"the replay buffer needs {_size(needed)} of memory more, and {_size(available)} are "
            f"left: other programs have taken memory since the run began; change {settings}, or "
            "let fewer runs share the machine (of a sweep: hydra.launcher.jobs)"
        )


def reserve_disk(file: Path) -> None:
    """Let the disk reserve the space of a file: a new one takes none until it is written to.

    A program that writes to a memory-mapped file on a full disk is killed by SIGBUS.

    Args:
        file: An existing file; its content is lost where the system cannot reserve (macOS).

    Raises:
        WriteError: If the disk is full; the message names the file and the free space.
    """
    size = file.stat().st_size
    with write_errors(file, size), file.open("r+b") as opened:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(opened.fileno(), 0, size)
            return
        for begin in range(0, size, _CHUNK):
            opened.write(bytes(min(_CHUNK, size - begin)))


def state_bytes(spec: TeamSpec) -> int:
    """Return the bytes of one team's observations, actions and flags in one step."""
    observations = sum(
        math.prod(layout.shape) * _itemsize(layout.dtype) for layout in spec.observations.values()
    )
    actions = sum(8 if layout.discrete else 4 * layout.size for layout in spec.actions.values())
    reward_and_flags = 4 + 2
    return spec.agents * (observations + actions + reward_and_flags)


def _itemsize(dtype: str) -> int:
    size: int = getattr(torch, dtype).itemsize
    return size

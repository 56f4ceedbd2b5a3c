"""Memory and disk space that learning will take: stated and checked before a run begins."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from veca_marl.algos.specs import TeamSpec

_SHARE = 0.9  # of what is available; the rest is left to networks, worlds and other programs
_CGROUP = Path("/sys/fs/cgroup")


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
        ValueError: If it does not fit; the message gives numbers and what to change.
    """
    settings = next((need.settings for need in needed.values() if need.settings), "")
    lines = []
    memory = sum(need.memory_bytes for need in needed.values())
    if memory:
        lines.append(_check("memory", memory, available_memory(), settings))
    folders = {need.folder for need in needed.values() if need.folder is not None}
    for folder in sorted(folders):
        disk = sum(need.disk_bytes for need in needed.values() if need.folder == folder)
        lines.append(_check(f"disk space in {folder}", disk, available_disk(folder), settings))
    return lines


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


def available_memory() -> int | None:
    """Return the bytes of memory that new data can take; None where the system does not say.

    On Linux that is ``MemAvailable``, or what is left of the limit of the process's control group
    (version 2: containers and batch schedulers), whichever is less.
    """
    known = [size for size in (_system_memory(), _cgroup_memory(_CGROUP)) if size is not None]
    return min(known, default=None)


def _system_memory(file: Path = Path("/proc/meminfo")) -> int | None:
    if not file.is_file():
        return None
    for line in file.read_text().splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return None


def _cgroup_memory(root: Path) -> int | None:
    """Return the rest of the limit of a control group; its file cache can be reclaimed."""
    limit, used, detail = (root / f"memory.{name}" for name in ("max", "current", "stat"))
    if not (limit.is_file() and used.is_file() and detail.is_file()):
        return None
    text = limit.read_text().strip()
    if text == "max":
        return None
    counts = dict(line.split() for line in detail.read_text().splitlines())
    return int(text) - int(used.read_text()) + int(counts.get("inactive_file", 0))


def available_disk(folder: Path) -> int:
    """Return the free bytes of the disk on which `folder` is, or will be."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return shutil.disk_usage(existing).free


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

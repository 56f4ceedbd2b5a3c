"""Memory that the control groups of this process leave: limits of containers and schedulers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

_MEMBERSHIP = Path("/proc/self/cgroup")
_ROOT = Path("/sys/fs/cgroup")
_NO_LIMIT = 2**62  # bytes; version 1 writes 2**63 less one page


@dataclass(frozen=True)
class _Version:
    """How a version of control groups lays out its files.

    Attributes:
        mounts: Folders of its hierarchy below the root.
        limit: File with the limit.
        used: File with what the group and those below it use.
        cache: Entry of ``memory.stat`` with the file cache that is not in use: it can be reclaimed.
    """

    mounts: tuple[str, ...]
    limit: str
    used: str
    cache: str

    def left(self, folder: Path) -> int | None:
        """Return what is left of the limit of one group; None without files or limit."""
        limit, used, detail = (folder / name for name in (self.limit, self.used, "memory.stat"))
        if not (limit.is_file() and used.is_file() and detail.is_file()):
            return None
        text = limit.read_text().strip()
        if text == "max" or int(text) >= _NO_LIMIT:
            return None
        counts = dict(line.split() for line in detail.read_text().splitlines())
        return int(text) - int(used.read_text()) + int(counts.get(self.cache, 0))


# a machine with both versions has the second one in a folder of its own
_FIRST = _Version(
    ("memory",), "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"
)
_SECOND = _Version((".", "unified"), "memory.max", "memory.current", "inactive_file")


def control_group_memory(membership: Path = _MEMBERSHIP, root: Path = _ROOT) -> int | None:
    """Return the bytes of memory that all limits of control groups leave; None without a limit.

    The limits of the process's group and of all groups above it hold at the same time.

    Args:
        membership: File that names the group in each hierarchy.
        root: Folder in which the hierarchies are mounted.
    """
    if not membership.is_file():
        return None
    lefts = [
        version.left(folder)
        for version, group in _groups(membership.read_text())
        for mount in version.mounts
        for folder in _up_to(root / mount, group)
    ]
    return min((left for left in lefts if left is not None), default=None)


def _groups(membership: str) -> Iterator[tuple[_Version, PurePosixPath]]:
    """Return the groups that limit memory; lines are ``hierarchy:controllers:path``."""
    for line in membership.splitlines():
        hierarchy, controllers, path = line.split(":", 2)
        if hierarchy == "0":
            yield _SECOND, PurePosixPath(path)
        elif "memory" in controllers.split(","):
            yield _FIRST, PurePosixPath(path)


def _up_to(mount: Path, group: PurePosixPath) -> Iterator[Path]:
    """Return the folders of a group and of those above it.

    In a container the path may be that of the machine, of which only the last group is mounted, or
    lead out of what is mounted (``..``): then the folder of the mount is the group.
    """
    inside = PurePosixPath(*group.parts[1:])
    if ".." not in inside.parts:
        yield from (mount / parent for parent in (inside, *inside.parents) if parent.parts)
    yield mount

"""Memory that is left for new data: what the system states, and the limits of control groups."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

# file with the limit of a group, file with what it uses, and the entry of its `memory.stat` with
# the file cache that is not in use and can be reclaimed
_SECOND_VERSION = ("memory.max", "memory.current", "inactive_file")
_FIRST_VERSION = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")


def available_memory(root: Path = Path("/")) -> int | None:
    """Return the bytes of memory that new data can take; None where the system does not say.

    On Linux that is ``MemAvailable``, or what is left of the limits of the process's control groups
    (containers and batch schedulers), whichever is less: the limits of its group and of all groups
    above it hold at the same time. Other systems have no ``/proc``.

    Args:
        root: The root of the file system.
    """
    meminfo = root / "proc/meminfo"
    if not meminfo.is_file():
        return None
    return min([1024 * _numbers(meminfo)["MemAvailable:"], *_left_by_groups(root)])


def _left_by_groups(root: Path) -> Iterator[int]:
    """Return what the limit of each group leaves."""
    membership = root / "proc/self/cgroup"
    lines = membership.read_text().splitlines() if membership.is_file() else []
    for line in lines:
        hierarchy, controllers, path = line.split(":", 2)
        if hierarchy == "0":
            mount, names = root / "sys/fs/cgroup", _SECOND_VERSION
        elif "memory" in controllers.split(","):
            mount, names = root / "sys/fs/cgroup/memory", _FIRST_VERSION
        else:
            continue
        # in a container the path may be one of the machine, which is not mounted: then the folder
        # of the mount is the group
        group = PurePosixPath(path.lstrip("/"))
        for folder in {mount, *(mount / above for above in (group, *group.parents))}:
            yield from _left(folder, *names)


def _left(group: Path, limit: str, used: str, cache: str) -> Iterator[int]:
    """Return what is left of the limit of one group, if it has one."""
    if not (group / limit).is_file() or not (group / used).is_file():
        return
    text = (group / limit).read_text().strip()
    if text != "max":  # the first version writes a number larger than any memory
        reclaimable = _numbers(group / "memory.stat").get(cache, 0)
        yield int(text) - int((group / used).read_text()) + reclaimable


def _numbers(file: Path) -> dict[str, int]:
    """Return the numbers of a file with lines of a name, a number and perhaps a unit."""
    words = (line.split() for line in file.read_text().splitlines())
    return {name: int(number) for name, number, *_ in words}

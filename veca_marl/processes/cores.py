"""The cores that this process may use."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from pathlib import Path

CORES = "VECA_MARL_CORES"
"""Environment variable with the number of cores that a command may use, if not all.

Sweeps set it for each of their runs.
"""

_QUOTA = Path("/sys/fs/cgroup/cpu.max")  # of a container with ``docker run --cpus``


class CoresError(ValueError):
    """The environment variable `CORES` is no number of cores."""


def usable_cores() -> int:
    """Return the number of cores that this process may use, at least 1.

    It is the least of the CPU affinity, the processor time that a control group (version 2) allows,
    and the environment variable `CORES`.

    Raises:
        CoresError: If `CORES` is no positive integer.
    """
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    numbers = [float(affinity or 1), *_quota(), *_asked()]
    return max(math.ceil(min(numbers)), 1)


def _quota() -> list[float]:
    """Return the cores of the control group; none without a limit, or where there are no groups."""
    with suppress(OSError, ValueError):
        allowed, period = map(float, _QUOTA.read_text(encoding="ascii").split())  # or "max 100000"
        return [allowed / period]
    return []


def _asked() -> list[float]:
    asked = os.environ.get(CORES)
    if asked is None:
        return []
    if not asked.isdecimal() or int(asked) < 1:
        raise CoresError(f"{CORES}={asked!r} must be a positive number of cores")
    return [float(asked)]

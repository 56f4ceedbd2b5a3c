"""Limits of the host for worker processes: shared memory and open files.

Batches of worker processes are in shared memory, of which a container has 64 MB by default. A
process that writes beyond the end of it is killed by SIGBUS.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from veca_marl.algos.collection.experience import CollectCfg, Engine
from veca_marl.algos.specs import TeamSpec
from veca_marl.processes.cores import usable_cores

SHARED_MEMORY = Path("/dev/shm")

# measured with KickTheBall and GrabObject: 1.04 to 1.07 times the observations before and after
# each step; actions, rewards and parameters are the rest
_PER_OBSERVATION = 2.3
_BASE_BYTES = 4_000_000
# measured: 110 and 123 files with two processes, mostly arrays of a batch
_BASE_FILES, _FILES_PER_ARRAY, _FILES_PER_PROCESS = 48, 6, 16


def shared_bytes(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> int:
    """Return an estimate of the shared memory that the batches of worker processes take, bytes.

    Args:
        cfg: Number of worlds and processes; without processes it is 0.
        specs: The arrays of each team.
    """
    if not _shares(cfg):
        return 0
    frame = sum(
        spec.agents * sum(layout.n_bytes for layout in spec.observations.values())
        for spec in specs.values()
    )
    return int(_PER_OBSERVATION * frame * cfg.frames) + _BASE_BYTES


def _shares(cfg: CollectCfg) -> bool:
    """Return whether batches are in shared memory; Ray writes what has no room there to disk."""
    return _processes(cfg) > 0 and cfg.engine is Engine.processes


def _processes(cfg: CollectCfg) -> int:
    return cfg.processes_on(usable_cores())


def open_files(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> int:
    """Return an estimate of the files that a run with worker processes has open."""
    if not _shares(cfg):
        return 0
    arrays = sum(len(spec.observations) + len(spec.actions) for spec in specs.values())
    return _BASE_FILES + _processes(cfg) * (_FILES_PER_PROCESS + _FILES_PER_ARRAY * arrays)


def available_shared_memory() -> int | None:
    """Return the free bytes of shared memory; None where it is not limited apart from memory."""
    if sys.platform != "linux" or not SHARED_MEMORY.is_dir():
        return None
    return shutil.disk_usage(SHARED_MEMORY).free


def allow_files(needed: int) -> int | None:
    """Raise the number of files that this process may have open, as far as the system lets it.

    Args:
        needed: How many it needs.

    Returns:
        How many it may have open now; None where there is no limit, or none that can be read.
    """
    try:
        import resource
    except ImportError:  # Windows
        return None
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return None
    if soft < needed:
        with suppress(ValueError, OSError):  # above the hard limit, or that of the system
            resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
            soft = needed
    return soft


def that_fits(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> tuple[CollectCfg, str]:
    """Return how experience can be collected on this host, and what was changed.

    Args:
        cfg: As configured.
        specs: The arrays of each team.

    Returns:
        `cfg` and an empty text if it fits; otherwise the same worlds in the process of the learner,
        and a sentence for the log.
    """
    shortages = []
    bytes_needed, free = shared_bytes(cfg, specs), available_shared_memory()
    if free is not None and bytes_needed > free:
        shortages.append(
            f"{bytes_needed / 1e6:.0f} MB of shared memory, {free / 1e6:.0f} MB are free in "
            f"{SHARED_MEMORY} (docker run --shm-size=1g)"
        )
    files_needed = open_files(cfg, specs)
    allowed = allow_files(files_needed)
    if allowed is not None and files_needed > allowed:
        shortages.append(f"{files_needed} open files, {allowed} are allowed (ulimit -n)")
    if not shortages:
        return cfg, ""
    return replace(cfg, processes=0), (
        f"collect.processes={_processes(cfg)} needs {' and '.join(shortages)}: all "
        f"{cfg.all_worlds} worlds are stepped in one process instead, which is slower"
    )

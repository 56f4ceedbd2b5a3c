"""Limits of the host for worker processes: shared memory and open files.

Batches of worker processes are in shared memory, in which containers have 64 MB by default. A
process that writes to more than there is is killed by SIGBUS.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.specs import TeamSpec

SHARED_MEMORY = Path("/dev/shm")

# measured with KickTheBall and GrabObject: 1.04 to 1.07 times the observations before and after
# each step; actions, rewards and parameters are the rest
_PER_OBSERVATION = 2.3
_BASE_BYTES = 4_000_000
# measured: 110 and 123 with two processes, one for each array of a batch
_BASE_FILES, _FILES_PER_ARRAY, _FILES_PER_PROCESS = 48, 6, 16


def shared_bytes(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> int:
    """Return the shared memory that the batches of worker processes take at most, about.

    Args:
        cfg: Number of worlds and processes; without processes it is 0.
        specs: The arrays of each team.
    """
    if cfg.processes == 0:
        return 0
    frame = sum(
        spec.agents * sum(layout.n_bytes for layout in spec.observations.values())
        for spec in specs.values()
    )
    return int(_PER_OBSERVATION * frame * cfg.frames) + _BASE_BYTES


def open_files(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> int:
    """Return how many files worker processes need to have open, about; see `shared_bytes`."""
    if cfg.processes == 0:
        return 0
    arrays = sum(len(spec.observations) + len(spec.actions) for spec in specs.values())
    return _BASE_FILES + cfg.processes * (_FILES_PER_PROCESS + _FILES_PER_ARRAY * arrays)


def available_shared_memory() -> int | None:
    """Return the free bytes of shared memory; None where it is not limited apart from memory."""
    if sys.platform != "linux" or not SHARED_MEMORY.is_dir():
        return None
    return shutil.disk_usage(SHARED_MEMORY).free


def available_files() -> int | None:
    """Return how many files a process may have open, after its limit was raised as far as it goes.

    Returns:
        None where there is no limit, or none that can be read.
    """
    try:
        import resource
    except ImportError:  # Windows
        return None
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and (hard == resource.RLIM_INFINITY or soft < hard):
        wanted = hard if hard != resource.RLIM_INFINITY else max(soft, 65_536)
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    return None if soft == resource.RLIM_INFINITY else soft


def that_fits(cfg: CollectCfg, specs: Mapping[str, TeamSpec]) -> tuple[CollectCfg, str]:
    """Return how experience can be collected on this host, and what was changed.

    Args:
        cfg: As configured.
        specs: The arrays of each team.

    Returns:
        `cfg` and an empty text if it fits; otherwise the same number of worlds in the process of
        the learner, and a sentence for the log.
    """
    shortages = []
    bytes_needed, free = shared_bytes(cfg, specs), available_shared_memory()
    if free is not None and bytes_needed > free:
        shortages.append(
            f"{bytes_needed / 1e6:.0f} MB of shared memory, {free / 1e6:.0f} MB are free in "
            f"{SHARED_MEMORY} (docker run --shm-size=1g)"
        )
    files_needed, allowed = open_files(cfg, specs), available_files()
    if allowed is not None and files_needed > allowed:
        shortages.append(f"{files_needed} open files, {allowed} are allowed (ulimit -n)")
    if not shortages:
        return cfg, ""
    one = replace(cfg, processes=0, worlds=cfg.all_worlds)
    return one, (
        f"collect.processes={cfg.processes} needs {' and '.join(shortages)}: all {one.worlds} "
        "worlds are stepped in one process instead, which is slower and draws other random numbers"
    )

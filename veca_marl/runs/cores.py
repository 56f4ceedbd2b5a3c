"""The cores that a run may use, and whether other programs use them too."""

from __future__ import annotations

import math
import os


def load() -> float:
    """Return the mean number of threads that ran in the last minute; 0 where it is not known."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0


def contention_warning(threads: int, cores: int, others: float) -> str:
    """Return a sentence for the log if several threads learn on cores that are in use.

    A parallel loop waits for its last thread. If another program interrupts that one, the others
    wait actively for a time slice of the system, in each of the hundreds of loops of a gradient
    step: beside one busy program on two cores, a step of the default network took 55 ms with two
    threads and 35 ms with one; beside several programs, seconds.

    Args:
        threads: Threads that learn.
        cores: Cores that they may use.
        others: Mean number of threads that ran before this run learnt, see `load`.

    Returns:
        The sentence; empty if one thread learns or there are cores for all.
    """
    if threads == 1 or others + threads < cores + 1.0:
        return ""
    return (
        f"the machine had a load of {others:.1f} in the last minute, and {threads} threads learn "
        f"on {cores} cores: if other programs go on using them, threads=1 is faster"
    )


def idle_cores_hint(groups: int, worlds: int, cores: int, others: float) -> str:
    """Return a sentence for the log if more worker processes could step as many worlds.

    The number of groups is part of the configuration of a run, not of the machine: each has its
    own random numbers, so that a run gives other results with another number.

    Args:
        groups: Groups of worlds of the run, each of which has a worker process.
        worlds: Worlds of each of them.
        cores: Cores that they may use.
        others: Mean number of threads that ran before this run, see `load`.

    Returns:
        The sentence; empty if there are no cores for at least twice as many processes.
    """
    total, free = groups * worlds, cores - math.ceil(others)
    more = max((n for n in range(1, min(total, free) + 1) if total % n == 0), default=0)
    if more < 2 * groups:
        return ""
    return (
        f"{groups} worker processes step {total} worlds on {cores} cores: "
        f"collect.groups={more} collect.worlds={total // more} makes batches of the same size "
        "on more of them, from other random numbers"
    )

"""How many runs share the cores of a machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def cores_of(config: Mapping[str, Any]) -> int:
    """Return the number of cores that a run can use at once.

    Its worker processes and its learner take turns, so it is the larger of both; a learner without
    a number of threads uses what is left.
    """
    collect = config["collect"]
    return int(max(1, collect["processes"] * collect["threads"], config["threads"] or 1))


def default_jobs(configs: list[Mapping[str, Any]], cores: int) -> int:
    """Return the number of runs at a time that fills the cores, at least one."""
    return max(1, min(len(configs), cores // max(map(cores_of, configs), default=1)))

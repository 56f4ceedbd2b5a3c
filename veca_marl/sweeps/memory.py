"""How many runs share the memory of a machine."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any

import torch
from omegaconf import DictConfig

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.storage import USABLE_SHARE
from veca_marl.config import Config, to_config
from veca_marl.runs.assembly import read_specs

_SAME_MEMORY = ("seed", "experiment")  # keys in which runs differ that store equally much


def memory_of_runs(configs: Iterable[tuple[DictConfig, Mapping[str, Any]]]) -> list[int]:
    """Return the bytes that the algorithms of each run store beside their parameters.

    Args:
        configs: The configuration of each run, typed and as plain data.

    Raises:
        ConfigError: If a configuration is impossible.
    """
    known: dict[str, int] = {}
    needed = []
    for node, plain in configs:
        key = json.dumps({k: v for k, v in plain.items() if k not in _SAME_MEMORY}, default=str)
        if key not in known:
            known[key] = memory_of_run(to_config(node))
        needed.append(known[key])
    return needed


def memory_of_run(cfg: Config) -> int:
    """Return the bytes that the algorithms of a run store; makes a world and networks (0.5 s)."""
    numbers = {
        team: (spec, cfg.learner.get(team, cfg.algo))
        for team, spec in read_specs(cfg.game).items()
        if team not in cfg.frozen
    }
    return sum(
        make_algorithm(team, spec, algo, torch.device("cpu")).storage_needed.memory_bytes
        for team, (spec, algo) in numbers.items()
    )


def runs_that_fit(needed: Sequence[int], available: int | None) -> int:
    """Return how many runs store what they need at the same time, whichever they are; at least one.

    Args:
        needed: Bytes of each run.
        available: Bytes of memory; None if unknown.
    """
    if available is None:
        return max(1, len(needed))
    largest_first = accumulate(sorted(needed, reverse=True))
    return max(1, sum(together <= USABLE_SHARE * available for together in largest_first))

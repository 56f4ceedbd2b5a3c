"""How many runs fit on this machine at the same time."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.storage import StorageNeeded, check_storage, runs_that_fit
from veca_marl.config import Config, ConfigError, one_line
from veca_marl.runs.assembly import read_specs

# Memory of the processes of a run beside replay buffers, an estimate. The sum of their proportional
# set sizes (Pss in proc(5)) was at most 2.0 GB for SAC on KickTheBall with the default network,
# which has four processes beside the learner, and 0.74 GB for `+experiment=smoke algo=sac`, which
# has none.
_LEARNER_BYTES = 750_000_000
_OTHER_BYTES = 350_000_000


def runs_at_once(configs: Mapping[str, Config]) -> int:
    """Return the number of runs that fit together, whichever of them they are; at least 1.

    One world is built and closed for each game with other teams, senses or bodies.

    Args:
        configs: Name of each run to its configuration.

    Raises:
        ConfigError: If a run does not fit alone, with its name and what to change.
    """
    known: dict[str, dict[str, StorageNeeded]] = {}
    needs = []
    for name, cfg in configs.items():
        key = repr((cfg.game, cfg.algo, cfg.learner, sorted(cfg.frozen)))
        try:
            if key not in known:
                known[key] = storage_of(cfg)
            check_storage(known[key])
        except ValueError as error:
            raise ConfigError(f"{name}: {one_line(error)}") from error
        needs.append({**known[key], "": StorageNeeded(_process_bytes(cfg))})
    return max(1, runs_that_fit(needs))


def storage_of(cfg: Config) -> dict[str, StorageNeeded]:
    """Return what each team of a run stores, from its specifications and numbers.

    Raises:
        ConfigError: If no world can be made.
        ValueError: If an algorithm cannot be made as configured.
    """
    cpu = torch.device("cpu")
    return {
        team: make_algorithm(team, spec, cfg.learner.get(team, cfg.algo), cpu).storage_needed
        for team, spec in read_specs(cfg.game).items()
        if team not in cfg.frozen
    }


def _process_bytes(cfg: Config) -> int:
    """Return the memory of the learner, of processes that collect, and of as many that evaluate."""
    return _LEARNER_BYTES + 2 * cfg.collect.processes * _OTHER_BYTES

"""Opponents that were learnt before and do not change: the actor of a team in a checkpoint."""

from __future__ import annotations

import pickle
from enum import Enum
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import ProbabilisticTensorDictSequential

from veca_marl.algos.checkpoint import CheckpointError
from veca_marl.algos.encoders import Pooling
from veca_marl.algos.networks import Critic, NetworkCfg, Parameters, Precision, TeamNetwork
from veca_marl.algos.specs import TeamSpec


def load_actor(path: Path, team: str, spec: TeamSpec) -> ProbabilisticTensorDictSequential:
    """Return what a team had learnt, to play and not to learn.

    Args:
        path: A checkpoint, or the folder of a run: its latest checkpoint.
        team: The team's name, there and here.
        spec: Its arrays here.

    Raises:
        CheckpointError: If there is no such checkpoint, or it does not hold this team.
    """
    content = _read(_file(path))
    stored = content["identity"]["specs"]
    learnt = content["state"]["algorithm"]
    if team not in learnt:
        raise CheckpointError(f"{path} has learnt the teams {sorted(learnt)}, not {team!r}")
    if stored[team] != spec.to_dict():
        raise CheckpointError(f"{path}: team {team!r} has other specs there than here")
    network = TeamNetwork(team, spec, _network_cfg(content["config"], team))
    network.load_state_dict(learnt[team]["network"])
    return network.actor.requires_grad_(False)


def _file(path: Path) -> Path:
    if path.is_file():
        return path
    found = sorted((path / "checkpoints").glob("frames_*.pt"))
    if not found:
        raise CheckpointError(f"{path} is neither a checkpoint nor the folder of a run with one")
    return found[-1]


def _read(path: Path) -> dict[str, Any]:
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise CheckpointError(f"cannot read the checkpoint {path}: {error}") from error
    if not isinstance(content, dict) or not {"identity", "config", "state"} <= content.keys():
        raise CheckpointError(f"{path} is not a checkpoint")
    return content


def _network_cfg(config: dict[str, Any], team: str) -> NetworkCfg:
    """Return the sizes of a team's network from the stored configuration of its run."""
    numbers = config["learner"].get(team, config["algo"])["network"]
    kinds: dict[str, type[Enum]] = {
        "precision": Precision,
        "critic": Critic,
        "parameters": Parameters,
        "pooling": Pooling,
    }
    return NetworkCfg(**{k: kinds[k][v] if k in kinds else v for k, v in numbers.items()})

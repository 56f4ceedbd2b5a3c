"""What a team learnt in another run: to play against, or to begin with."""

from __future__ import annotations

import pickle
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import ProbabilisticTensorDictSequential

from veca_marl.algos.networks.actor_critic import (
    Critic,
    NetworkCfg,
    Parameters,
    Precision,
    TeamNetwork,
)
from veca_marl.algos.networks.encoders import Pooling
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.training.checkpoint import CheckpointError, check_format


def load_actor(path: Path, team: str, spec: TeamSpec) -> ProbabilisticTensorDictSequential:
    """Return what a team had learnt, to play and not to learn.

    Args:
        path: A checkpoint, or the folder of a run: its latest checkpoint.
        team: The team's name, there and here.
        spec: Its arrays here.

    Raises:
        CheckpointError: If there is no such checkpoint, or it does not hold this team.
    """
    network, _ = _load(path, team, spec)
    return network.actor.requires_grad_(False)


def load_network(path: Path, team: str, spec: TeamSpec, cfg: NetworkCfg) -> dict[str, Any]:
    """Return the state of a team's network, for a learner to begin with.

    Args:
        path: See `load_actor`.
        team: See `load_actor`.
        spec: See `load_actor`.
        cfg: What the network shall be here.

    Raises:
        CheckpointError: See `load_actor`; also if the network was another one there.
    """
    network, stored = _load(path, team, spec)
    there, here = asdict(stored), asdict(cfg)
    other = [f"{k}={there[k]} there, {here[k]} here" for k in here if there[k] != here[k]]
    if other:
        raise CheckpointError(f"{path}: team {team!r} has another network: {'; '.join(other)}")
    return network.state_dict()


def _load(path: Path, team: str, spec: TeamSpec) -> tuple[TeamNetwork, NetworkCfg]:
    content = _read(_file(path))
    stored = content["identity"]["specs"]
    learnt = content["state"]["algorithm"]
    if team not in learnt:
        raise CheckpointError(f"{path} has learnt the teams {sorted(learnt)}, not {team!r}")
    if stored[team] != spec.to_dict():
        raise CheckpointError(f"{path}: team {team!r} has other specs there than here")
    cfg = _network_cfg(content["config"], team)
    network = TeamNetwork(team, spec, cfg)
    network.load_state_dict(learnt[team]["network"])
    return network, cfg


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
    return check_format(path, content)


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

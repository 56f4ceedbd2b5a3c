"""What a team learnt in another run: to play against, to evaluate, or to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torch import nn

from veca_marl.algos.algorithm import (
    ALGORITHMS,
    Algorithm,
    AlgorithmCfg,
    make_algorithm,
)
from veca_marl.algos.checkpoints.checkpoint_file import (
    CheckpointError,
    load_errors,
    map_checkpoint,
)
from veca_marl.algos.checkpoints.identity import spec_differences
from veca_marl.algos.networks.factory import NETWORKS, NetworkCfg
from veca_marl.algos.networks.precision import for_acting
from veca_marl.algos.plain import from_plain
from veca_marl.algos.sense_encoders import sense_encoders
from veca_marl.algos.specs import TeamSpec


def load_actor(path: Path, team: str, spec: TeamSpec) -> TensorDictModuleBase:
    """Return the policy of a team from another run, without gradients.

    Args:
        path: A checkpoint, or the folder of a run: its latest checkpoint.
        team: Name of the team, there and here.
        spec: Its arrays here.

    Raises:
        CheckpointError: If there is no such checkpoint, or it does not hold this team.
    """
    algorithm, content = _make(path, team, spec)
    with load_errors(path):
        algorithm.actor.load_state_dict(content["state"]["actors"][team])
    return for_acting(algorithm.actor.requires_grad_(False))


def load_learnt(path: Path, team: str, spec: TeamSpec) -> Algorithm:
    """Return the algorithm of a team with what another run has learnt, for `Algorithm.init_from`.

    Args:
        path: See `load_actor`.
        team: See `load_actor`.
        spec: See `load_actor`.

    Raises:
        CheckpointError: See `load_actor`.
    """
    algorithm, content = _make(path, team, spec)
    with load_errors(path):
        algorithm.load_learnt(content["state"]["algorithm"][team])
    return algorithm


def load_encoders(path: Path, team: str) -> dict[str, list[nn.Module]]:
    """Return the encoders of a team from another run, whatever its task and its actions are.

    Args:
        path: See `load_actor`.
        team: Name of the team there.

    Returns:
        Sense to one module, or to one for each agent.

    Raises:
        CheckpointError: If there is no such checkpoint, or it does not hold this team.
    """
    algorithm, content = _make(path, team, None)
    with load_errors(path):
        algorithm.actor.load_state_dict(content["state"]["actors"][team])
    return sense_encoders(algorithm.actor)


def teams_learnt(path: Path) -> list[str]:
    """Return the names of the teams that a run has learnt.

    Raises:
        CheckpointError: If there is no such checkpoint.
    """
    return sorted(map_checkpoint(_file(path))["algorithms"])


def _make(path: Path, team: str, spec: TeamSpec | None) -> tuple[Algorithm, dict[str, Any]]:
    """Return the algorithm of a team, not yet loaded, and the content of the checkpoint.

    Args:
        path: See `load_actor`.
        team: Name of the team there.
        spec: What its arrays have to be; None for any.
    """
    content = map_checkpoint(_file(path))
    stored, learnt = content["identity"]["specs"], content["algorithms"]
    if team not in learnt:
        raise CheckpointError(f"{path} has learnt the teams {sorted(learnt)}, not {team!r}")
    if spec is not None and (differing := spec_differences(stored[team], spec)):
        raise CheckpointError(f"{path}: team {team!r} has other specs there: {differing}")
    spec = spec or TeamSpec.from_dict(stored[team])
    try:
        cfg = from_plain(AlgorithmCfg, learnt[team], _find_type)
        return make_algorithm(team, spec, cfg, torch.device("cpu")), content
    except ValueError as error:
        raise CheckpointError(f"{path}: team {team!r}: {error}") from error


def _find_type(base: type, name: str) -> type:
    if issubclass(base, AlgorithmCfg):
        return ALGORITHMS.find(name).cfg_type
    return NETWORKS.find(name).cfg_type if issubclass(base, NetworkCfg) else base


def _file(path: Path) -> Path:
    if path.is_file():
        return path
    found = sorted((path / "checkpoints").glob("frames_*.pt"))
    if not found:
        raise CheckpointError(f"{path} is neither a checkpoint nor the folder of a run with one")
    return found[-1]

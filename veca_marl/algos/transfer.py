"""What a team learnt in another run: to play against, to evaluate, or to start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torch import nn

from veca_marl.algos.algorithm import ALGORITHMS, Algorithm, AlgorithmCfg, make_algorithm
from veca_marl.algos.checkpoints import (
    CheckpointError,
    checkpoints_in,
    from_plain,
    load_errors,
    map_checkpoint,
    spec_differences,
)
from veca_marl.algos.networks.encoders import for_acting
from veca_marl.algos.networks.factory import NETWORKS, NetworkCfg
from veca_marl.algos.sense_encoders import sense_encoders
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.training.learners import TeamLearners


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
    found = checkpoints_in(path / "checkpoints")
    if not found:
        raise CheckpointError(f"{path} is neither a checkpoint nor the folder of a run with one")
    return found[-1]


def init_teams(
    learners: TeamLearners,
    teams: Mapping[str, str],
    encoders: Mapping[str, Mapping[str, str]],
) -> None:
    """Copy parameters of other runs, first those of whole teams, then single encoders.

    A source is the folder of a run or a checkpoint, and ``:TEAM`` where several teams learnt
    in it and none has the name of the team of this run.

    Args:
        learners: What starts.
        teams: Team to the source of all its parameters; its specification must be equal: senses,
            actions, number of agents, and whether agents can be eliminated.
        encoders: Team to sense to the source of its encoder; the shape of the sense must be equal.

    Raises:
        CheckpointError: If a source cannot be read or does not fit; the message says why.
    """
    for team, source in teams.items():
        _init_team(learners, team, source)
    for team, sources in encoders.items():
        for sense, source in sources.items():
            _init_encoder(learners, team, sense, source)


def _init_team(learners: TeamLearners, team: str, source: str) -> None:
    with _naming(f"init_from.{team}={source}"):
        path, stored_team = _find(source, team)
        stored = load_learnt(path, stored_team, learners.specs[team])
        learners.algorithms[team].init_from(stored)


def _init_encoder(learners: TeamLearners, team: str, sense: str, source: str) -> None:
    with _naming(f"init_encoders.{team}.{sense}={source}"):
        path, stored_team = _find(source, team)
        found = load_encoders(path, stored_team)
        if sense not in found:
            choices = ", ".join(sorted(found)) or "none"
            raise CheckpointError(f"{path} has no encoder of {sense}; choices: {choices}")
        learners.algorithms[team].init_encoders({sense: found[sense]})


@contextmanager
def _naming(option: str) -> Iterator[None]:
    """Raise errors as `CheckpointError` with the option in front."""
    try:
        yield
    except (CheckpointError, ValueError) as error:
        raise CheckpointError(f"{option}: {error}") from error


def _find(source: str, team: str) -> tuple[Path, str]:
    """Return the path of a source and the name of the team in it."""
    path, named = _split(source)
    learnt = teams_learnt(path)
    if named or team in learnt:
        return path, named or team
    if len(learnt) == 1:
        return path, learnt[0]
    raise CheckpointError(f"{path} has learnt the teams {learnt}, not {team!r}; write {path}:TEAM")


def _split(source: str) -> tuple[Path, str]:
    """Return the path and the name of the team, which is empty if the source names none."""
    if Path(source).exists() or ":" not in source:
        return Path(source), ""
    path, _, team = source.rpartition(":")
    return Path(path), team

"""Teams that start from what another run has learnt: all of it, or encoders of single senses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from veca_marl.algos.checkpoints.checkpoint_file import CheckpointError
from veca_marl.algos.checkpoints.stored import load_encoders, load_learnt, teams_learnt
from veca_marl.algos.training.learners import TeamLearners


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

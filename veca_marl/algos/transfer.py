"""What a team learnt in another run: to play against, to evaluate, or to start from."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torch import nn
from torch.utils._python_dispatch import TorchDispatchMode

from veca_marl.algos.algorithm import ALGORITHMS, Algorithm, AlgorithmCfg, make_algorithm
from veca_marl.algos.checkpoint_files import Verify
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
from veca_marl.algos.policy_files import read_policy
from veca_marl.algos.sense_encoders import sense_encoders
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.training.finite import check_stored
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.policy_paths import SUFFIX, policy_path


def load_actor(path: Path, team: str, spec: TeamSpec) -> TensorDictModuleBase:
    """Return the policy of a team from another run, without gradients.

    Args:
        path: A checkpoint, or the folder of a run: its latest checkpoint.
        team: Name of the team, there and here.
        spec: Its arrays here.

    Raises:
        CheckpointError: If there is no such checkpoint, or it does not hold this team.
    """
    algorithm, stored = _make(path, team, spec)
    _load_actor(path, algorithm, stored, team)
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
    algorithm, stored = _make(path, team, spec)
    learnt = stored.state.get("algorithm", {}).get(team)
    if learnt is None:  # the file of a policy may hold its actor alone
        _load_actor(path, algorithm, stored, team)
    else:
        with load_errors(path):
            algorithm.load_learnt(_Checked(learnt, stored.check))
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
    algorithm, stored = _make(path, team, None)
    _load_actor(path, algorithm, stored, team)
    return sense_encoders(algorithm.actor)


def _load_actor(path: Path, algorithm: Algorithm, stored: _Stored, team: str) -> None:
    with load_errors(path):
        state = stored.state["actors"][team]
        stored.check(state)
        algorithm.actor.load_state_dict(state)


@dataclass(frozen=True)
class _Stored:
    """The state in the file of a checkpoint.

    Attributes:
        state: Its content; each entry has to be checked before it is used.
        verify: See `map_checkpoint`.
    """

    state: Mapping[str, Any]
    verify: Verify

    def check(self, entry: Any) -> None:
        """Check that the numbers in an entry are those that were stored, and finite."""
        self.verify(entry)
        check_stored({"state": entry})


class _Checked(dict[str, Any]):
    """A state whose entries are checked when they are used; others are not read from the disk.

    Args:
        state: The entries.
        check: Raises an exception for a damaged one.
    """

    def __init__(self, state: Mapping[str, Any], check: Callable[[Any], None]) -> None:
        super().__init__(state)
        self._check = check

    def __getitem__(self, key: str) -> Any:
        entry = super().__getitem__(key)
        self._check(entry)
        return entry

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, checked, or the default."""
        if key not in self:
            return default
        return self[key]

    def items(self) -> Any:
        """Return all entries, checked."""
        return [(key, self[key]) for key in self]


def teams_learnt(path: Path) -> list[str]:
    """Return the names of the teams that a run has learnt.

    Raises:
        CheckpointError: If there is no such checkpoint.
    """
    return sorted(_mapped(_file(path))[0]["algorithms"])


def _make(path: Path, team: str, spec: TeamSpec | None) -> tuple[Algorithm, _Stored]:
    """Return the algorithm of a team, not yet loaded, and the state in the checkpoint.

    Args:
        path: See `load_actor`.
        team: Name of the team there.
        spec: What its arrays have to be; None for any.
    """
    file = _file(path)
    content, verify = _mapped(file)
    stored, learnt = content["identity"]["specs"], content["algorithms"]
    if team not in learnt or team not in stored:
        raise CheckpointError(f"{path} has learnt the teams {sorted(learnt)}, not {team!r}")
    if spec is not None and (differing := spec_differences(stored[team], spec)):
        raise CheckpointError(
            f"{path}: team {team!r} has other specs there: {differing}. The game has to have "
            "the same body and senses; `python -m veca_marl.zoo list` has the words of the zoo's"
        )
    spec = spec or TeamSpec.from_dict(stored[team])
    try:
        with load_errors(path), _Allocations(file.stat().st_size):
            cfg = from_plain(AlgorithmCfg, learnt[team], _find_type)
            algorithm = make_algorithm(team, spec, cfg, torch.device("cpu"))
    except CheckpointError as error:
        raise CheckpointError(f"{error} (team {team!r})") from error
    return algorithm, _Stored(content["state"], verify)


_aten = torch.ops.aten
_ALLOCATING = (
    _aten.empty.memory_format,
    _aten.empty_strided.default,
    _aten.zeros.default,
    _aten.ones.default,
    _aten.full.default,
    _aten.rand.default,
    _aten.randn.default,
)


class _Allocations(TorchDispatchMode):
    """Refuses to make networks that are far larger than the file that holds their parameters.

    The numbers of a stored algorithm could ask for more memory than there is.

    Args:
        size: Bytes of the file.
    """

    def __init__(self, size: int) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._left = 16 * size + 2**28

    def __torch_dispatch__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: Any = None
    ) -> Any:
        if func in _ALLOCATING:
            self._left -= 4 * math.prod(args[0])
            if self._left < 0:
                raise ValueError(f"its networks, such as {list(args[0])}, do not fit into the file")
        return func(*args, **(kwargs or {}))


def _find_type(base: type, name: str) -> type:
    if issubclass(base, AlgorithmCfg):
        return ALGORITHMS.find(name).cfg_type
    return NETWORKS.find(name).cfg_type if issubclass(base, NetworkCfg) else base


def _mapped(path: Path) -> tuple[dict[str, Any], Verify]:
    """Return the content of a checkpoint, or of a policy without its run; see `map_checkpoint`."""
    if path.suffix == SUFFIX:
        return read_policy(path), lambda entry: None  # verified as a whole
    return map_checkpoint(path)


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

    A source is the folder of a run, a checkpoint or ``zoo/NAME``, and ``:TEAM`` where several teams
    learnt in it and none has the name of the team of this run.

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
        return policy_path(source), ""
    path, _, team = source.rpartition(":")
    return policy_path(path), team

"""Specs of an environment of equal games, and how the actions of a step are read."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.data import Bounded, Categorical, Composite, TensorSpec, Unbounded

from veca_marl.envs.core.game import ActionSpec, Game, from_parts
from veca_marl.envs.core.task import SOLVED, Player
from veca_marl.sim.sense import ArraySpec

DONE_KEYS = ("done", "terminated", "truncated")
STATE = "state"


class EnvSpecs(NamedTuple):
    """The specs of an environment of `worlds` equal games; each has the shape `(worlds,)`."""

    observation: Composite
    action: Composite
    reward: Composite
    done: Composite


def env_specs(game: Game, teams: list[str], worlds: int, state_size: int | None) -> EnvSpecs:
    """Return the specs of an environment.

    Args:
        game: One of its games.
        teams: The teams that take actions.
        worlds: Number of games.
        state_size: Length of the key `state`; None if there is none.
    """
    specs = EnvSpecs(*(Composite(shape=(worlds,)) for _ in EnvSpecs._fields))
    specs.done.update(done_spec((worlds,)))
    if state_size is not None:
        specs.observation[STATE] = Unbounded((worlds, state_size))
    for team in teams:
        player, *_ = players = game.team(team)
        batch = (worlds, len(players))
        specs.observation[team] = Composite(
            observation=sense_specs(_senses_of(game, player.name), batch),
            info=info_spec(game, player, batch),
            shape=batch,
        )
        if game.task.eliminates:
            mask = Categorical(2, shape=batch, dtype=torch.bool)
            specs.observation[team, "mask"] = mask
        specs.action[team] = action_spec(player.body.action_spec, batch)
        specs.reward[team] = Composite(reward=Unbounded((*batch, 1)), shape=batch)
        specs.done[team] = Composite(done_spec(batch), shape=batch)
    return specs


def info_spec(game: Game, player: Player, batch: tuple[int, ...]) -> Composite:
    """Return a team's `info`.

    It has one leaf per reward term and per entry of `Body.info`, and `solved` if the task has a
    goal.

    Args:
        game: The game.
        player: One of the team.
        batch: Batch size of the team.
    """
    names = (*game.weights, *player.body.info())
    spec = Composite({name: Unbounded((*batch, 1)) for name in names}, shape=batch)
    if game.task.has_goal():
        spec[SOLVED] = Categorical(2, shape=(*batch, 1), dtype=torch.bool)
    return spec


def _senses_of(game: Game, player: str) -> dict[str, ArraySpec]:
    senses = game.senses[player].values()
    return {name: spec for sense in senses for name, spec in sense.specs.items()}


def to_torchrl(spec: ArraySpec, batch: tuple[int, ...]) -> TensorSpec:
    """Return the spec of one array; an integer without shape is a choice among `high + 1`.

    The spec of an array that lacks a bound is `Unbounded`.
    """
    dtype = getattr(torch, np.dtype(spec.dtype).name)
    if spec.is_discrete:
        return Categorical(int(spec.high) + 1, shape=batch, dtype=dtype)
    shape = (*batch, *spec.shape)
    if np.isfinite(spec.low) and np.isfinite(spec.high):
        return Bounded(spec.low, spec.high, shape, dtype=dtype)
    return Unbounded(shape, dtype=dtype)


def sense_specs(senses: dict[str, ArraySpec], batch: tuple[int, ...]) -> Composite:
    """Return a team's `observation`: one leaf per sense."""
    return Composite({name: to_torchrl(one, batch) for name, one in senses.items()}, shape=batch)


def action_spec(parts: ActionSpec, batch: tuple[int, ...]) -> Composite:
    """Return a team's `action`: one leaf, or a composite of several named parts."""
    leaves = from_parts({part: to_torchrl(spec, batch) for part, spec in parts.items()})
    action = Composite(leaves, shape=batch) if isinstance(leaves, dict) else leaves
    return Composite(action=action, shape=batch)


def done_spec(batch: tuple[int, ...]) -> dict[str, TensorSpec]:
    """Return the three flags."""
    return {key: Categorical(2, shape=(*batch, 1), dtype=torch.bool) for key in DONE_KEYS}


# all players of a team in all worlds: one array ``(W, n, ...)``, or one for each part of the action
TeamActions = NDArray[Any] | dict[str, NDArray[Any]]


class ActionReader:
    """Reads one team's actions from the tensordict of a step, and checks their shapes.

    Args:
        team: The team's name.
        spec: Spec of `(team, "action")`.
    """

    def __init__(self, team: str, spec: TensorSpec) -> None:
        self._team = team
        self._spec = spec
        self._parts = dict(spec.items()) if isinstance(spec, Composite) else {}

    def read(self, tensordict: TensorDictBase) -> TeamActions:
        """Return the actions as numpy arrays.

        Raises:
            ValueError: If a tensor has another shape than its spec, or a type that numpy lacks.
        """
        action = tensordict.get((self._team, "action"))
        if not self._parts:
            return _to_numpy(f"action of {self._team}", action, self._spec)
        # TorchRL's policies write log-probabilities beside the parts
        if not isinstance(action, TensorDictBase) or not self._parts.keys() <= set(action.keys()):
            raise ValueError(
                f"action of {self._team} must be a tensordict with the parts {list(self._parts)}"
            )
        return {
            part: _to_numpy(f"action {part!r} of {self._team}", action.get(part), leaf)
            for part, leaf in self._parts.items()
        }


def action_of(actions: TeamActions, world: int, player: int) -> Any:
    """Return the action of one player: an array, or a mapping of parts."""
    if isinstance(actions, dict):
        return {part: array[world, player] for part, array in actions.items()}
    return actions[world, player]


def _to_numpy(what: str, action: Any, spec: TensorSpec) -> NDArray[Any]:
    if not isinstance(action, torch.Tensor):
        got = "missing" if action is None else f"a {type(action).__name__}"
        raise ValueError(f"{what} is {got}: it must be a tensor of shape {tuple(spec.shape)}")
    if action.shape != spec.shape:
        raise ValueError(f"{what}: shape {tuple(action.shape)}, not {tuple(spec.shape)}")
    plain = action.is_cpu and not action.requires_grad
    try:
        array: NDArray[Any] = action.numpy() if plain else action.numpy(force=True)
    except TypeError:  # numpy has no such numbers
        raise ValueError(f"{what}: dtype {action.dtype}, not {spec.dtype}") from None
    return array

"""An environment that says what its experts would do in each state that a policy reaches."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite, TensorSpec

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.env_specs import TeamActions
from veca_marl.envs.adapters.torchrl.fast_step import Arrays, Layout
from veca_marl.envs.core.expert import check_expert, find_expert
from veca_marl.envs.core.game import Outcome, from_parts
from veca_marl.envs.core.game_cfg import GameCfg

LABEL = "expert_action"


class LabelledEnv(VecaEnv):
    """`VecaEnv` with ``(team, "expert_action")``: the action of the expert in the present state.

    It has the form of the team's action, one leaf or a leaf for each part, and stands beside the
    observation: at the root before a step, under ``next`` after it. The expert is asked once per
    step and never acts; its own state is that of an episode that others play. Where an action was
    not the label, it is told so (`Expert.follow_body`). The label of a player that is eliminated,
    and of a state in which the episode has ended, is zero.

    Args:
        cfg: See `VecaEnv`.
        worlds: See `VecaEnv`.
        seed: See `VecaEnv`.
        teams: Names of the teams with labels.

    Raises:
        ValueError: See `VecaEnv`; also if the task has no expert that can play these teams.
    """

    def __init__(
        self,
        cfg: GameCfg,
        worlds: int = 1,
        seed: int | None = None,
        *,
        teams: Collection[str],
        first_world: int = 0,
    ) -> None:
        super().__init__(cfg, worlds, seed, first_world=first_world)
        self._labelled = [team for team in self.group_map if team in teams]
        expert = find_expert(cfg.task.name)
        for player in self.games[0].actors:
            if player.team in self._labelled:
                check_expert(expert, player, self.games[0].world.clock)
        self._add_specs()
        specs = self.full_action_spec
        self._labels = {team: _zeros(specs[team, "action"]) for team in self._labelled}
        self._differs = {team: np.zeros(specs[team].shape, bool) for team in self._labelled}

    def _add_specs(self) -> None:
        spec: Composite = self.observation_spec.clone()
        for team in self._labelled:
            spec[team, LABEL] = self.full_action_spec[team, "action"].clone()
        self.observation_spec = spec
        self._start = Layout(spec)
        given = spec.clone().update(self.full_reward_spec).update(self.full_done_spec)
        self._next = Layout(given)

    @property
    def observation_keys(self) -> list[Any]:
        """See `VecaEnv`; labels are for learning only."""
        return [key for key in super().observation_keys if key[1:2] != (LABEL,)]

    def _reset(
        self, tensordict: TensorDictBase | None = None, *, episode: int | None = None
    ) -> TensorDict:
        state = super()._reset(tensordict, episode=episode)
        for world in self._selected(tensordict, "_reset"):
            for team in self._labelled:
                self._differs[team][world] = False
            self._label(world, state)
        return state

    def _command(self, worlds: list[int], actions: dict[str, TeamActions]) -> None:
        super()._command(worlds, actions)
        for team in self._labelled:
            self._differs[team] = _differ(self._labels[team], actions[team])

    def _score(self, world: int, arrays: Arrays, outcome: Outcome) -> None:
        super()._score(world, arrays, outcome)
        if not outcome.done:
            self._label(world, arrays)

    def _label(self, world: int, data: Any) -> None:
        """Write the labels of a world into arrays, or tensors, of all worlds."""
        game = self.games[world]
        for team in self._labelled:
            for index, player in enumerate(game.team(team)):
                if player.name in game.eliminated:
                    continue
                row, expert = (world, index), game.expert_of(player)
                if self._differs[team][row]:
                    expert.follow_body()
                command = expert.act(game.observe(player, expert.reads))
                label = from_parts(player.body.encode(command))
                _write(data[team][LABEL], row, label)
                _write(self._labels[team], row, label)


def _zeros(spec: TensorSpec) -> TeamActions:
    """Return zeros of the form of a team's action, ``(W, n, ...)``."""
    zeros = spec.zero()
    if isinstance(zeros, TensorDictBase):
        return {part: np.asarray(value) for part, value in zeros.items()}
    return np.asarray(zeros)


def _differ(one: TeamActions, other: TeamActions) -> NDArray[np.bool_]:
    """Return in which worlds and of which players two actions differ, ``(W, n)``."""
    pairs = zip(_parts(one), _parts(other), strict=True)
    unequal = [(a != b).reshape(*a.shape[:2], -1).any(-1) for a, b in pairs]
    differs: NDArray[np.bool_] = np.logical_or.reduce(unequal)
    return differs


def _parts(actions: TeamActions) -> list[NDArray[Any]]:
    return [actions[part] for part in sorted(actions)] if isinstance(actions, dict) else [actions]


def _write(target: Any, row: tuple[int, int], label: Any) -> None:
    if isinstance(label, dict):
        for part, value in label.items():
            _write(target[part], row, value)
    elif isinstance(target, torch.Tensor):
        target[row] = torch.from_numpy(np.asarray(label))
    else:
        target[row] = label

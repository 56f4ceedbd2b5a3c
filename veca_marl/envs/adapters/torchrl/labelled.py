"""An environment that says what its experts would do in each state that a policy reaches."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.fast_step import Arrays, Layout
from veca_marl.envs.core.expert import check_expert, find_expert
from veca_marl.envs.core.game import Outcome, from_parts
from veca_marl.envs.core.game_cfg import GameCfg

LABEL = "expert_action"


class LabelledEnv(VecaEnv):
    """`VecaEnv` with ``(team, "expert_action")``: the action of the expert in the present state.

    It has the form of the team's action, one leaf or a leaf for each part, and stands beside the
    observation: at the root before a step, under ``next`` after it. The expert is asked once per
    step and never acts; its own state is that of an episode that others play. The label of a player
    that is eliminated, and of a state in which the episode has ended, is zero.

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
            self._label(world, state)
        return state

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
                expert = game.expert_of(player)
                command = expert.act(game.observe(player, expert.reads))
                label = from_parts(player.body.encode(command))
                _write(data[team][LABEL], (world, index), label)


def _write(target: Any, row: tuple[int, int], label: Any) -> None:
    if isinstance(label, dict):
        for part, value in label.items():
            _write(target[part], row, value)
    elif isinstance(target, torch.Tensor):
        target[row] = torch.from_numpy(np.asarray(label))
    else:
        target[row] = label

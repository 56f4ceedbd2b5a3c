"""A task as a TorchRL environment: W worlds in one process behind one batched `EnvBase`."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite, Unbounded
from torchrl.envs import EnvBase

from veca_marl.envs.game import Game, GameCfg, Outcome
from veca_marl.envs.spectator import Spectator
from veca_marl.envs.specs import done_spec, observation_spec, to_torchrl


class VecaEnv(EnvBase):
    """W equal games in one process, `batch_size=[W]`, one TorchRL group per team.

    Keys, with n players in a team::

        (team, "observation", sense)   (W, n, *sense shape)
        (team, "action")               (W, n, A) float32 in [-1, 1], or (W, n) int64
        (team, "terms", name)          (W, n, 1) unweighted reward terms of the last step
        (team, "reward")               (W, n, 1) weighted sum of the terms
        (team, "done" | "terminated" | "truncated")  (W, n, 1), and the same at the root (W, 1)

    Args:
        cfg: What is played.
        worlds: How many games.
        seed: Seed of the first world's randomness; world i draws from its own stream.

    Raises:
        ValueError: If there is less than one world, or the configuration is impossible.
    """

    def __init__(self, cfg: GameCfg, worlds: int = 1, seed: int = 0) -> None:
        if worlds < 1:
            raise ValueError(f"worlds={worlds}: at least one is needed")
        super().__init__(device=None, batch_size=torch.Size([worlds]))
        self.cfg = cfg
        self.games = [Game(cfg) for _ in range(worlds)]
        self._teams = [team.name for team in type(self.games[0].task).teams]
        self.group_map = {
            team: [player.name for player in self.games[0].team(team)] for team in self._teams
        }
        self._term_names = tuple(self.games[0].weights)
        self._make_specs()
        self.spectator = Spectator(self.games[0])
        self.set_seed(seed)

    def _make_specs(self) -> None:
        worlds = self.batch_size[0]
        observed, action, reward = (Composite(shape=(worlds,)) for _ in range(3))
        done = Composite(done_spec((worlds,)), shape=(worlds,))
        self._sense_specs = {}
        for team in self._teams:
            players = self.games[0].team(team)
            batch = (worlds, len(players))
            specs = {
                name: spec
                for sense in self.games[0].senses[players[0].name].values()
                for name, spec in sense.specs.items()
            }
            self._sense_specs[team] = specs
            observed[team] = observation_spec(specs, self._term_names, *batch)
            action[team] = Composite(
                action=to_torchrl(players[0].body.action_spec, batch), shape=batch
            )
            reward[team] = Composite(reward=Unbounded((*batch, 1)), shape=batch)
            done[team] = Composite(done_spec(batch), shape=batch)
        self.observation_spec, self.action_spec = observed, action
        self.reward_spec, self.done_spec = reward, done

    def _set_seed(self, seed: int | None) -> None:
        worlds = self.batch_size[0]
        self._rngs = [
            np.random.default_rng(None if seed is None else [seed, world]) for world in range(worlds)
        ]

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        wanted = None if tensordict is None else tensordict.get("_reset", None)
        mask = np.ones(len(self.games), bool) if wanted is None else wanted.numpy().ravel()
        buffers = self._new_arrays()
        for world in np.flatnonzero(mask):
            self.games[world].reset(self._rngs[world])
            self._observe(world, buffers, None)
        return self._as_tensordict(buffers)

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        actions = {team: self._action_rows(team, tensordict) for team in self._teams}
        buffers = self._new_arrays()
        worlds = len(self.games)
        terminated, truncated = np.zeros((worlds, 1), bool), np.zeros((worlds, 1), bool)
        for world, game in enumerate(self.games):
            rows = {
                name: actions[team][world, index]
                for team, names in self.group_map.items()
                for index, name in enumerate(names)
            }
            outcome = self._play(world, game, rows)
            self._observe(world, buffers, outcome)
            terminated[world], truncated[world] = outcome.terminated, outcome.truncated
        stepped = self._as_tensordict(buffers)
        self._add_rewards(stepped, buffers)
        self._add_dones(stepped, torch.from_numpy(terminated), torch.from_numpy(truncated))
        return stepped

    def _play(self, world: int, game: Game, rows: dict[str, NDArray[Any]]) -> Outcome:
        try:
            return game.step(rows, self._rngs[world])
        except ValueError as error:
            raise ValueError(f"world {world}, {error}") from None

    def _action_rows(self, team: str, tensordict: TensorDictBase) -> NDArray[Any]:
        action = tensordict.get((team, "action"))
        expected = self.full_action_spec[team, "action"].shape
        if action.shape != expected:
            raise ValueError(f"action of {team}: shape {tuple(action.shape)}, not {tuple(expected)}")
        return action.detach().cpu().numpy()

    def _new_arrays(self) -> dict[str, dict[str, NDArray[Any]]]:
        """New arrays for one step: whoever stores a step must not see it change."""
        worlds = len(self.games)
        return {
            team: {
                **{
                    name: np.zeros((worlds, len(self.group_map[team]), *spec.shape), spec.dtype)
                    for name, spec in self._sense_specs[team].items()
                },
                "terms": np.zeros(
                    (len(self._term_names), worlds, len(self.group_map[team]), 1), np.float32
                ),
            }
            for team in self._teams
        }

    def _observe(
        self, world: int, buffers: dict[str, dict[str, NDArray[Any]]], outcome: Outcome | None
    ) -> None:
        game = self.games[world]
        for team in self._teams:
            for index, player in enumerate(game.team(team)):
                for name, value in game.observe(player).items():
                    buffers[team][name][world, index] = value
                if outcome is not None:
                    terms = outcome.terms[player.name]
                    values = [terms[name] for name in self._term_names]
                    buffers[team]["terms"][:, world, index, 0] = values

    def _as_tensordict(self, buffers: dict[str, dict[str, NDArray[Any]]]) -> TensorDict:
        worlds = len(self.games)
        teams = {}
        for team in self._teams:
            batch = (worlds, len(self.group_map[team]))
            senses = {
                name: torch.from_numpy(buffers[team][name]) for name in self._sense_specs[team]
            }
            terms = torch.from_numpy(buffers[team]["terms"])
            named = dict(zip(self._term_names, terms, strict=True))
            teams[team] = TensorDict(
                {"observation": TensorDict(senses, batch), "terms": TensorDict(named, batch)}, batch
            )
        return TensorDict(teams, (worlds,))

    def _add_rewards(
        self, stepped: TensorDict, buffers: dict[str, dict[str, NDArray[Any]]]
    ) -> None:
        weights = np.array([self.games[0].weights[name] for name in self._term_names], np.float32)
        for team in self._teams:
            reward = np.tensordot(weights, buffers[team]["terms"], axes=1)
            stepped[team].set("reward", torch.from_numpy(reward))

    def _add_dones(
        self, stepped: TensorDict, terminated: torch.Tensor, truncated: torch.Tensor
    ) -> None:
        flags = {
            "terminated": terminated,
            "truncated": truncated,
            "done": terminated | truncated,
        }
        for key, flag in flags.items():
            stepped.set(key, flag)
            for team in self._teams:
                per_player = flag.unsqueeze(1).repeat(1, len(self.group_map[team]), 1)
                stepped[team].set(key, per_player)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close all worlds."""
        for game in self.games:
            game.close()
        super().close(raise_if_closed=raise_if_closed)

"""A task as a TorchRL environment: W worlds in one process behind one batched `EnvBase`."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Categorical, Composite, Unbounded

from veca_marl.envs.adapters.torchrl.actions import ActionReader, TeamActions, action_of
from veca_marl.envs.adapters.torchrl.layout import Arrays, Layout
from veca_marl.envs.adapters.torchrl.lean_env import LeanEnv
from veca_marl.envs.adapters.torchrl.specs import action_spec, done_spec, observation_spec
from veca_marl.envs.core.episodes import Episodes, fresh_seed
from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.rendering.spectator import Spectator
from veca_marl.sim.compilation import announce_compilation


class VecaEnv(LeanEnv):
    """W equal games in one process, `batch_size=[W]`, one TorchRL group per team.

    World w equals, bit by bit, the only world of `VecaEnv(cfg, 1, seed, first_world=w)`: with
    `_step` masks (a masked world does not move and keeps its data, as in TorchRL's `SerialEnv`)
    and with partial resets.

    Keys, with n players in a team::

        (team, "observation", sense)   (W, n, *sense shape)
        (team, "action")               (W, n, A) float32 in [-1, 1], or (W, n) int64
        (team, "action", part)         instead, for a body whose action has several parts
        (team, "terms", name)          (W, n, 1) unweighted reward terms of the last step
        (team, "reward")               (W, n, 1) weighted sum of the terms
        (team, "done" | "terminated" | "truncated")  (W, n, 1), and the same at the root (W, 1)
        (team, "mask")                 (W, n) bool, in tasks that eliminate: False who is out

    The flags at the root say when a game is over for everyone and starts anew. A player can be out
    before (`Task.is_eliminated`): it stays in the batch with its flags up, its mask down, zeros as
    observation and reward, and its action is not looked at.

    Teams that follow a script (`GameCfg.script`) are part of the world: they have no keys.

    Args:
        cfg: What is played.
        worlds: How many games.
        seed: All randomness of an episode follows from it, the number of the world and the number
            of the episode; None is fresh entropy.
        first_world: Number of the first world.

    Raises:
        ValueError: If there is less than one world, or the configuration is impossible.
    """

    def __init__(
        self, cfg: GameCfg, worlds: int = 1, seed: int | None = None, *, first_world: int = 0
    ) -> None:
        if worlds < 1:
            raise ValueError(f"worlds={worlds}: at least one is needed")
        announce_compilation()
        super().__init__(device=None, batch_size=torch.Size([worlds]))
        self.cfg = cfg
        self._first_world = first_world
        self.games = [Game(cfg) for _ in range(worlds)]
        self._teams = [team.name for team in cfg.teams if team.name not in cfg.script]
        self._eliminates = type(self.games[0].task).eliminates
        self.group_map = {
            team: [player.name for player in self.games[0].team(team)] for team in self._teams
        }
        self._players = [{team: game.team(team) for team in self._teams} for game in self.games]
        self._make_specs()
        self.spectator = Spectator(self.games[0])
        self.set_seed(seed)

    def _make_specs(self) -> None:
        worlds = self.batch_size[0]
        observed, action, reward = (Composite(shape=(worlds,)) for _ in range(3))
        done = Composite(done_spec((worlds,)), shape=(worlds,))
        for team in self._teams:
            players = self._players[0][team]
            batch = (worlds, len(players))
            specs = {
                name: spec
                for sense in self.games[0].senses[players[0].name].values()
                for name, spec in sense.specs.items()
            }
            observed[team] = observation_spec(specs, tuple(self.games[0].weights), *batch)
            if self._eliminates:
                observed[team, "mask"] = Categorical(2, shape=batch, dtype=torch.bool)
            action[team] = action_spec(players[0].body.action_spec, batch)
            reward[team] = Composite(reward=Unbounded((*batch, 1)), shape=batch)
            done[team] = Composite(done_spec(batch), shape=batch)
        self.observation_spec, self.action_spec = observed, action
        self.reward_spec, self.done_spec = reward, done
        self._actions = {team: ActionReader(team, action[team, "action"]) for team in self._teams}
        self._start = Layout(observed)
        self._next = Layout(observed.clone().update(reward).update(done))

    def _set_seed(self, seed: int | None) -> None:
        seed = fresh_seed() if seed is None else seed
        self.episodes = [
            Episodes(seed, self._first_world + world) for world in range(self.batch_size[0])
        ]

    def _reset(
        self, tensordict: TensorDictBase | None = None, *, episode: int | None = None, **_: Any
    ) -> TensorDict:
        """Begin episodes in the worlds that `_reset` names, or in all.

        Args:
            tensordict: May hold a `_reset` mask.
            episode: Number of the episode to begin; None is the one after the last.
        """
        arrays = self._start.new()
        for world in self._chosen(tensordict, "_reset"):
            game = self.games[world]
            game.reset(self.episodes[world].next(episode))
            self._players[world] = {team: game.team(team) for team in self._teams}
            self._observe(world, arrays, out=frozenset())
        return self._start.tensordict(arrays)

    def _chosen(self, tensordict: TensorDictBase | None, mask: str) -> list[int]:
        """Return the worlds that a mask `(W,)` or `(W, 1)` names; all if there is none."""
        chosen = None if tensordict is None else tensordict.get(mask, None)
        if chosen is None:
            return list(range(len(self.games)))
        return [world for world, (flag,) in enumerate(chosen.view(-1, 1).tolist()) if flag]

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        worlds = self._chosen(tensordict, "_step")
        for team in self._teams:  # left there by TorchRL 0.14's rollout(break_when_all_done=True),
            tensordict.get(team).pop("_neg_step", None)  # which then fails on its own key
        self._command(worlds, {team: self._actions[team].read(tensordict) for team in self._teams})
        arrays = self._next.new()
        if len(worlds) < len(self.games):
            still = sorted(set(range(len(self.games))) - set(worlds))
            self._next.copy_rows(tensordict, arrays, still)
        for world in worlds:
            game = self.games[world]
            out = game.out
            outcome = game.advance()
            self._observe(world, arrays, out)
            self._score(world, arrays, outcome)
        return self._next.tensordict(arrays)

    def _command(self, worlds: list[int], actions: dict[str, TeamActions]) -> None:
        """Apply the actions in all worlds that will step before any of them moves."""
        for world in worlds:
            game = self.games[world]
            rows = {
                name: action_of(actions[team], world, index)
                for team, names in self.group_map.items()
                for index, name in enumerate(names)
            }
            try:
                game.command(rows)
            except ValueError as error:
                raise ValueError(f"world {world}, {error}") from None

    def _observe(self, world: int, arrays: Arrays, out: frozenset[str]) -> None:
        """Let all players of a world perceive but those who were out before this step."""
        game = self.games[world]
        for team, players in self._players[world].items():
            senses = arrays[team]["observation"]
            for index, player in enumerate(players):
                if self._eliminates:
                    arrays[team]["mask"][world, index] = player.name not in game.out
                if player.name in out:
                    continue
                for name, value in game.observe(player).items():
                    senses[name][world, index] = value

    def _score(self, world: int, arrays: Arrays, outcome: Outcome) -> None:
        """Pay all players of a world, and say whether their game is over."""
        game = self.games[world]
        _flag(arrays, world, outcome.terminated, outcome.truncated)
        for team, players in self._players[world].items():
            for index, player in enumerate(players):
                over = outcome.terminated_for(player.name)
                _flag(arrays[team], (world, index), over, outcome.truncated)
                terms = outcome.terms[player.name]
                arrays[team]["reward"][world, index] = game.pay(terms)
                for name, value in terms.items():
                    arrays[team]["terms"][name][world, index] = value

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close all worlds."""
        for game in self.games:
            game.close()
        super().close(raise_if_closed=raise_if_closed)


def _flag(arrays: Arrays, index: int | tuple[int, int], terminated: bool, truncated: bool) -> None:
    """Put the flags up that are up; new arrays have them down."""
    if terminated or truncated:
        arrays["terminated"][index] = terminated
        arrays["truncated"][index] = truncated
        arrays["done"][index] = True

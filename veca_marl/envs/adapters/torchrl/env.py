"""A task as a TorchRL environment: W worlds in one process behind one batched `EnvBase`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from veca_marl.envs.adapters.hosts import HERE, Host
from veca_marl.envs.adapters.seeded_game import NotCopied
from veca_marl.envs.adapters.torchrl.env_specs import (
    STATE,
    ActionReader,
    TeamActions,
    action_of,
    env_specs,
)
from veca_marl.envs.adapters.torchrl.fast_step import Arrays, FastStepEnv, Layout
from veca_marl.envs.core.episodes import Episodes, check_integer, fresh_seed
from veca_marl.envs.core.game import Outcome, describe_teams, refuse_closed
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.snapshot import Restoring, Snapshot, Snapshots
from veca_marl.envs.core.task import SOLVED


class VecaEnv(NotCopied, FastStepEnv):
    """W equal games in one process, `batch_size=[W]`, one TorchRL group per team.

    Keys, with n players in a team::

        (team, "observation", sense)   (W, n, *sense shape)
        (team, "action")               (W, n, A) float32 in [-1, 1], or (W, n) int64
        (team, "action", part)         instead, for a body whose action has several parts
        (team, "reward")               (W, n, 1) float32, weighted sum of the reward terms
        (team, "info", term)           (W, n, 1) float32, unweighted reward terms, for logs
        (team, "info", "solved")       (W, n, 1) bool, in tasks with a goal: whether it is reached
        (team, "info", "refused_verbs")  (W, n, 1) float32, for walkers with verbs: 1 if the verb of
                                       this step had no effect
        (team, "done" | "terminated" | "truncated")  (W, n, 1), and the same at the root (W, 1)
        (team, "mask")                 (W, n) bool, in tasks that eliminate: False if eliminated
        "state"                        (W, S) float32, with `GameCfg.global_state`: what the
                                       simulator knows, see `GlobalState`

    The flags at the root are up when the episode has ended for all players; the world is then
    reset. A player can be eliminated before (`Task.is_eliminated`): it stays in the batch with its
    flags up, its mask False, zeros as observation and reward, and its action is ignored.

    Teams that follow a script (`GameCfg.script`) are part of the world: they have no keys.

    World w equals, bit by bit, the only world of `VecaEnv(cfg, 1, seed, first_world=w)`: with
    `_step` masks (a masked world does not move and keeps its data, as in TorchRL's `SerialEnv`)
    and with partial resets. The randomness of an episode depends on the seed, the number of the
    world and the number of the episode alone. `reset(episode=k)` begins episode k.

    Attributes:
        cfg: The configuration of the games.
        games: The games, one per world.
        episodes: The numbers and generators of the episodes, one per world.
        first_world: Number of the first world; a change takes effect with the next `set_seed`.
        spectators: Renderers for people, one per world.

    Args:
        cfg: What to play.
        worlds: Number of games.
        seed: Seed of all randomness; None is fresh entropy.
        first_world: Number of the first world.
        fast_step: Whether to replace two internal methods of TorchRL by shorter ones with the same
            results, see `fast_step.py`; not done with a version of TorchRL that was not tested.
        host: Where the games are played.

    Raises:
        ValueError: If there is less than one world, or the configuration is impossible.
    """

    def __init__(
        self,
        cfg: GameCfg,
        worlds: int = 1,
        seed: int | None = None,
        *,
        first_world: int = 0,
        fast_step: bool = True,
        host: Host = HERE,
    ) -> None:
        check_integer("worlds", worlds, least=1)
        if seed is not None:
            check_integer("seed", seed)
        super().__init__(fast_step, torch.Size([worlds]))
        # TorchRL's `is_closed` is also True before the first reset
        self._worlds_closed = False
        self.cfg = cfg
        self.first_world = first_world
        self._host = host
        self.games = host.make(cfg, worlds)
        self._teams = [team.name for team in cfg.teams if team.name not in cfg.script]
        self._eliminates = self.games[0].task.eliminates
        self.group_map = {
            team: [player.name for player in self.games[0].team(team)] for team in self._teams
        }
        self.spectators = [host.view(game) for game in self.games]
        self._states = [host.state(game) for game in self.games if cfg.global_state]
        self._make_specs()
        self._snapshots: Snapshots | None = None
        self.set_seed(seed)

    def _make_specs(self) -> None:
        state_size = self._states[0].size if self._states else None
        specs = env_specs(self.games[0], self._teams, len(self.games), state_size)
        self.observation_spec, self.action_spec = specs.observation, specs.action
        self.reward_spec, self.done_spec = specs.reward, specs.done
        self._actions = {
            team: ActionReader(team, specs.action[team, "action"]) for team in self._teams
        }
        self._start = Layout(specs.observation)
        self._next = Layout(specs.observation.clone().update(specs.reward).update(specs.done))

    @property
    def observation_keys(self) -> list[Any]:
        """The observations, masks and the global state; `info` is for logs."""
        return [key for key in super().observation_keys if key[1:2] != ("info",)]

    def __repr__(self) -> str:
        """Return the task, the worlds, the agents, and what they sense and do."""
        teams = describe_teams(self.games[0])
        return f"VecaEnv({self.cfg.task.name}, worlds={len(self.games)}, {teams})"

    def _set_seed(self, seed: int | None) -> None:
        seed = fresh_seed() if seed is None else seed
        self.episodes = [
            Episodes(seed, self.first_world + world) for world in range(len(self.games))
        ]

    def _reset(
        self, tensordict: TensorDictBase | None = None, *, episode: int | None = None
    ) -> TensorDict:
        """Begin episodes in the worlds that the mask `_reset` selects, or in all.

        Args:
            tensordict: May contain the mask.
            episode: Number of the episode to begin; None is the one after the last.
        """
        refuse_closed(self._worlds_closed)
        arrays = self._start.new()
        worlds = self._selected(tensordict, "_reset")
        rngs = [self.episodes[world].next(episode) for world in worlds]
        self._host.reset([self.games[world] for world in worlds], rngs)
        for world in worlds:
            self._observe(world, arrays, frozenset())
        return self._start.tensordict(arrays, self.device)

    def _selected(self, tensordict: TensorDictBase | None, mask: str) -> list[int]:
        """Return the worlds that a mask `(W,)` or `(W, 1)` selects; all if there is none."""
        selected = None if tensordict is None else tensordict.get(mask, None)
        if selected is None:
            return list(range(len(self.games)))
        return [world for world, flag in enumerate(selected.flatten().tolist()) if flag]

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        refuse_closed(self._worlds_closed)
        worlds = self._selected(tensordict, "_step")
        self._command(worlds, {team: self._actions[team].read(tensordict) for team in self._teams})
        arrays = self._next.new()
        if len(worlds) < len(self.games):
            self._keep(tensordict, arrays, worlds)
        outcomes = self._host.advance([self.games[world] for world in worlds])
        for world in worlds:
            eliminated = self.games[world].eliminated
            outcome = next(outcomes)
            self._observe(world, arrays, eliminated)
            self._score(world, arrays, outcome)
        return self._next.tensordict(arrays, self.device)

    def _keep(self, tensordict: TensorDictBase, arrays: Arrays, stepping: list[int]) -> None:
        """Copy the data of the worlds that do not step."""
        kept = sorted(set(range(len(self.games))) - set(stepping))
        self._next.copy_rows(tensordict, arrays, kept)
        for team in self._teams:
            # TorchRL 0.14's rollout(break_when_all_done=True) leaves this key in nested data, and
            # fails when it stacks steps with and without it
            tensordict.get(team).pop("_neg_step", None)

    def _command(self, worlds: list[int], actions: dict[str, TeamActions]) -> None:
        """Set the actions in all worlds that step, before any of them moves."""
        for world in worlds:
            by_player = {
                name: action_of(actions[team], world, index)
                for team, names in self.group_map.items()
                for index, name in enumerate(names)
            }
            try:
                self.games[world].command(by_player)
            except ValueError as error:
                raise ValueError(f"world {world}, {error}") from None

    def _observe(self, world: int, arrays: Arrays, eliminated: frozenset[str]) -> None:
        """Write the observations of a world, except of players eliminated in earlier steps."""
        game = self.games[world]
        if self._states:
            arrays[STATE][world] = self._states[world].read()
        for team in self._teams:
            senses = arrays[team]["observation"]
            for index, player in enumerate(game.team(team)):
                if self._eliminates:
                    arrays[team]["mask"][world, index] = player.name not in game.eliminated
                if player.name in eliminated:
                    continue
                for name, value in game.observe(player).items():
                    senses[name][world, index] = value

    def _score(self, world: int, arrays: Arrays, outcome: Outcome) -> None:
        """Write the rewards, their terms and the flags of a world."""
        game = self.games[world]
        _raise_flags(arrays, world, outcome.terminated, outcome.truncated)
        for team, names in self.group_map.items():
            for index, name in enumerate(names):
                row, terms = (world, index), outcome.terms[name]
                ended = outcome.terminated_for(name)
                _raise_flags(arrays[team], row, ended, outcome.truncated)
                arrays[team]["reward"][row] = game.reward_of(terms)
                for term, value in terms.items():
                    arrays[team]["info"][term][row] = value
                for entry, number in outcome.bodies[name].items():
                    arrays[team]["info"][entry][row] = number
                if outcome.solved:
                    arrays[team]["info"][SOLVED][row] = outcome.solved[name]

    def snapshot(self, worlds: Sequence[int] | None = None) -> list[Snapshot]:
        """Return the states of worlds between two steps, from which `restore` continues.

        Args:
            worlds: Numbers of the worlds in this environment; None is all of them.

        Raises:
            IndexError: If there is no such world.
            RuntimeError: If one was never reset, or the environment is closed.
            SnapshotError: If a plug-in holds what is no data, such as a generator that runs.
        """
        refuse_closed(self._worlds_closed)
        chosen = self._chosen(worlds)
        if self._snapshots is None:
            self._snapshots = Snapshots(self.games[0])
        return [self._snapshots.take(self.games[w], self.episodes[w].state) for w in chosen]

    def restore(
        self, snapshots: Snapshot | Sequence[Snapshot], worlds: Sequence[int] | None = None
    ) -> TensorDict:
        """Return worlds to the states of snapshots; what follows is equal to what followed there.

        The episodes after the present one are those of the world that the snapshot is of.

        Args:
            snapshots: One for each of the worlds, or one for all of them; of any environment with
                the same configuration, also of another process.
            worlds: Numbers of the worlds in this environment; None is all of them.

        Returns:
            The observations of all worlds, as `reset` returns them: zeros for eliminated players.

        Raises:
            IndexError: If there is no such world.
            RuntimeError: If the environment is closed.
            SnapshotError: If a snapshot is that of another configuration.
            ValueError: If there is another number of snapshots than of worlds.
        """
        refuse_closed(self._worlds_closed)
        chosen = self._chosen(worlds)
        each = [snapshots] * len(chosen) if isinstance(snapshots, Snapshot) else list(snapshots)
        if len(each) != len(chosen):
            raise ValueError(f"{len(each)} snapshots for {len(chosen)} worlds {chosen}")
        pairs = zip(chosen, each, strict=True)
        checked = [Restoring(self.games[world], snapshot) for world, snapshot in pairs]
        for world, restoring in zip(chosen, checked, strict=True):
            restoring.restore()
            self.episodes[world] = restoring.episodes
        arrays = self._start.new()
        for world, game in enumerate(self.games):
            if game.has_begun:
                self._observe(world, arrays, game.eliminated)
        observed = self._start.tensordict(arrays, self.device)
        return self.full_done_spec.zero().update(observed)

    def _chosen(self, worlds: Sequence[int] | None) -> list[int]:
        """Return the numbers of worlds; raise `IndexError` if there is no such world."""
        count = len(self.games)
        chosen = list(range(count)) if worlds is None else list(worlds)
        if not all(0 <= world < count for world in chosen):
            raise IndexError(f"worlds={chosen}; there are {count} worlds, from 0 on")
        return chosen

    def render(self, world: int = 0, **choices: Any) -> NDArray[np.uint8]:
        """Return a picture of the game for people, with what an agent perceives beside it.

        Args:
            world: Number of the world in this environment.
            **choices: Fields of `veca_marl.envs.rendering.FilmCfg`, such as
                ``camera="above"``, ``agent="red"``, ``width=1280``, ``panels=False``.

        Returns:
            ``(height, width, 3)`` uint8, RGB; by default 360 x 640.

        Raises:
            IndexError: If there is no such world.
            RuntimeError: If the world was never reset, or the environment is closed.
            TypeError: If there is no such field.
            ValueError: If a value is impossible.
        """
        refuse_closed(self._worlds_closed)
        if not 0 <= world < len(self.games):
            raise IndexError(f"world={world}; there are {len(self.games)} worlds, from 0 on")
        if not self.games[world].has_begun:
            raise RuntimeError("no episode has begun: call reset() before render()")
        return self.spectators[world].frame(**choices)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close all worlds."""
        self._worlds_closed = True
        for game in self.games:
            game.close()
        super().close(raise_if_closed=raise_if_closed)


def _raise_flags(
    arrays: Arrays, index: int | tuple[int, int], terminated: bool, truncated: bool
) -> None:
    """Set the flags that are up; in new arrays they are down."""
    if terminated or truncated:
        arrays["terminated"][index] = terminated
        arrays["truncated"][index] = truncated
        arrays["done"][index] = True

"""The episodes of one world, one after another: what the Gymnasium and PettingZoo adapters share.

The order of observations and rewards is that of `VecaEnv`: the same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.adapters.hosts import HERE, Host
from veca_marl.envs.adapters.human_window import HumanWindow
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Observation, describe_teams, refuse_closed
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.snapshot import Restoring, Snapshot, Snapshots
from veca_marl.envs.core.task import SOLVED
from veca_marl.envs.rendering import FilmQuality

HUMAN = "human"
RENDER_MODES = (HUMAN, "rgb_array")


class Step(NamedTuple):
    """The result of one step for the players that took part in it, by name.

    Attributes:
        observations: Observations after the step.
        rewards: Weighted sums of the reward terms.
        terms: Unweighted reward terms by player and name.
        terminated: Whether the episode has ended by the rules.
        truncated: Whether the time is up; the same for all players.
        done: Whether the episode has ended for all players.
        solved: Whether the goal of the task is reached; empty for a task without a goal.
        bodies: What the bodies report, see `Body.info`.
    """

    observations: dict[str, Observation]
    rewards: dict[str, float]
    terms: dict[str, dict[str, float]]
    terminated: dict[str, bool]
    truncated: bool
    done: bool
    solved: dict[str, bool]
    bodies: Mapping[str, Mapping[str, float]]

    def info(self, name: str) -> dict[str, Any]:
        """Return the info of a player: `terms`, `Body.info`, and `solved` in a task with a goal."""
        info: dict[str, Any] = {"terms": dict(self.terms[name]), **self.bodies[name]}
        if name in self.solved:
            info[SOLVED] = self.solved[name]
        return info


class NotCopied:
    """An environment that is neither copied nor pickled: its world is in the memory of PyBullet."""

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse `copy.copy`, `copy.deepcopy` and `pickle`.

        Raises:
            TypeError: Always; it says what to do instead.
        """
        raise TypeError(
            f"{type(self).__name__} cannot be copied or pickled: its world is in the memory of "
            "PyBullet. Pass a function that makes it to other processes; make it again with the "
            "same arguments and seed, and reset it to the same episode, for the same world"
        )


class SeededGame:
    """World 0 of a `VecaEnv` with the same seed, without TorchRL.

    Attributes:
        game: The game.
        names: The players whose actions are given to `step`, team by team.
        metadata: `metadata` of a Gymnasium or PettingZoo environment.

    Args:
        cfg: What to play.
        seed: As for `VecaEnv`; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called; `human` shows each reset and step in a
            window.
        host: Where the game is played.

    Raises:
        ModuleNotFoundError: If a window is wanted, without the extra ``[play]``.
        ValueError: If there is no such render mode, or the seed is negative.
    """

    def __init__(
        self, cfg: GameCfg, seed: int | None, render_mode: str | None, host: Host = HERE
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode={render_mode!r}; choices: {[None, *RENDER_MODES]}")
        self._episodes = Episodes(seed)
        self._window: HumanWindow | None = None
        if render_mode == HUMAN:
            self._window = HumanWindow(cfg.task.name, cfg.clock.control_rate_hz)
        (self.game,) = host.make(cfg, 1)
        self.names = [player.name for player in self.game.actors]
        self._snapshots: Snapshots | None = None
        self.metadata: dict[str, Any] = {
            "name": cfg.task.name,
            "render_modes": list(RENDER_MODES),
            "render_fps": cfg.clock.control_rate_hz,
        }
        self._view = host.view(self.game)
        self._state = host.state(self.game)
        self._render_mode = render_mode
        self._running = False
        self._closed = False

    def described(self, adapter: str) -> str:
        """Return the `repr` of the environment that plays it."""
        return f"{adapter}({self.game.cfg.task.name}, {describe_teams(self.game)})"

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> dict[str, Observation]:
        """Begin an episode and return the observations of all players.

        Args:
            seed: Restarts the count of episodes, as `VecaEnv.set_seed`; None continues it.
            options: `{"episode": number}` begins the episode of this number; `{"world": number}`
                continues with the episodes of this world of a `VecaEnv`, from 0 on. Other options
                are ignored, because PettingZoo's own test passes one.

        Raises:
            RuntimeError: If the environment is closed.
            ValueError: If the seed or a number is negative.
        """
        refuse_closed(self._closed)
        if options is not None and not isinstance(options, Mapping):
            raise ValueError(f"options={options!r} must be a mapping, such as {{'episode': 3}}")
        chosen = options or {}
        # a refused number leaves the episodes as they are
        episodes = self._episodes if seed is None else Episodes(seed)
        if "world" in chosen:
            episodes = Episodes(episodes.seed, chosen["world"])
        rng = episodes.next(chosen.get("episode"))
        self._episodes = episodes
        self.game.reset(rng)
        self._running = True
        self._show()
        return self._observe(self.names)

    @property
    def rng(self) -> np.random.Generator | None:
        """The generator of the current episode; None before the first."""
        return self.game.rng

    def snapshot(self) -> Snapshot:
        """Return the state between two steps, from which `restore` continues.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
            SnapshotError: If a plug-in holds what is no data, such as a generator that runs.
        """
        refuse_closed(self._closed)
        if not self._running:
            raise RuntimeError("no episode is running: call reset() before snapshot()")
        if self._snapshots is None:
            self._snapshots = Snapshots(self.game)
        return self._snapshots.take(self.game, self._episodes.state)

    def restore(self, snapshot: Snapshot) -> dict[str, Observation]:
        """Return to the state of a snapshot, and return the observations of all players.

        Args:
            snapshot: Of any environment with the same configuration, also of another process.

        Raises:
            RuntimeError: If the environment is closed.
            SnapshotError: If it is that of another configuration.
        """
        refuse_closed(self._closed)
        restoring = Restoring(self.game, snapshot)
        restoring.restore()
        self._episodes = restoring.episodes
        self._running = True
        return self._observe(self.names)

    def first_info(self, name: str) -> dict[str, Any]:
        """Return the info of a player at a reset: the entries of `Step.info`, with terms of 0."""
        player = next(one for one in self.game.actors if one.name == name)
        terms = dict.fromkeys(self.game.weights, 0.0)
        info: dict[str, Any] = {"terms": terms, **player.body.info()}
        return info | ({SOLVED: False} if self.game.task.has_goal() else {})

    def step(self, actions: Mapping[str, Any]) -> Step:
        """Play one step.

        Args:
            actions: The action of each player by name; eliminated players need none.

        Returns:
            The result for each player that was not eliminated before the step.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
            ValueError: If an action is missing, invalid, or for an unknown player.
        """
        refuse_closed(self._closed)
        if not self._running:
            raise RuntimeError("no episode is running: call reset() before step()")
        names = self.playing
        outcome = self.game.step(actions)
        self._running = not outcome.done
        self._show()
        return Step(
            self._observe(names),
            {name: float(self.game.reward_of(outcome.terms[name])) for name in names},
            {name: outcome.terms[name] for name in names},
            {name: outcome.terminated_for(name) for name in names},
            outcome.truncated,
            outcome.done,
            {name: outcome.solved[name] for name in names if name in outcome.solved},
            outcome.bodies,
        )

    @property
    def state_size(self) -> int:
        """Length of `state`."""
        return self._state.size

    def state(self) -> NDArray[np.float32]:
        """Return what the simulator knows, see `GlobalState`.

        Raises:
            RuntimeError: If no episode has begun, or the environment is closed.
        """
        refuse_closed(self._closed)
        if self.rng is None:
            raise RuntimeError("no episode has begun: call reset() before state()")
        return self._state.read()

    @property
    def playing(self) -> list[str]:
        """The players in `names` that are not eliminated."""
        return [name for name in self.names if name not in self.game.eliminated]

    def _observe(self, names: Sequence[str]) -> dict[str, Observation]:
        """Return the observations of some players, in arrays of their own."""
        return {
            player.name: {name: np.array(a) for name, a in self.game.observe(player).items()}
            for player in self.game.actors
            if player.name in names
        }

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the game for people, ``(360, 640, 3)`` uint8.

        Returns:
            The picture; None with `render_mode="human"`, where a window shows it.

        Raises:
            RuntimeError: If the environment was made without `render_mode`, not yet reset, or is
                closed.
        """
        refuse_closed(self._closed)
        if self._render_mode is None:
            raise RuntimeError(f"made without a render_mode; choices: {list(RENDER_MODES)}")
        if self.rng is None:
            raise RuntimeError("no episode has begun: call reset() before render()")
        if self._window is not None:  # it shows this moment already
            return None
        return self._view.frame()

    def _show(self) -> None:
        """Show this moment in the window, if there is one."""
        if self._window is not None and not self._window.is_closed:
            # a window has to keep the speed of the clock
            self._window.show(self._view.frame(width=960, height=540, quality=FilmQuality.fast))

    def close(self) -> None:
        """Release the resources of the world."""
        self._running, self._closed = False, True
        if self._window is not None:
            self._window.close()
        self.game.close()

"""One task in one world with its players and their senses, in numpy.

Every adapter (TorchRL, Gymnasium, PettingZoo) plays its episodes through this class.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from numbers import Real
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.built_objects import BuiltObjects
from veca_marl.envs.core.expert import Expert, check_expert, find_expert
from veca_marl.envs.core.game_cfg import GameCfg, Script
from veca_marl.envs.core.task import Player, Team, find_task
from veca_marl.sim.body import make_body
from veca_marl.sim.physics import World
from veca_marl.sim.sense import ArraySpec, Sense, SpecError
from veca_marl.sim.senses import make_senses

ActionSpec = Mapping[str, ArraySpec]
Parts = dict[str, NDArray[Any]]


def only_part(spec: ActionSpec) -> str | None:
    """Return the name of the single part of an action; None if there are several."""
    return next(iter(spec)) if len(spec) == 1 else None


def to_parts(spec: ActionSpec, action: Any) -> Mapping[str, Any]:
    """Return an action as a mapping of parts; the body checks names and values.

    Args:
        spec: The parts of the body's action.
        action: A mapping of parts, or the plain array of a body with one part.

    Raises:
        ValueError: If an action that has several parts is not a mapping.
    """
    if isinstance(action, Mapping):
        return action
    part = only_part(spec)
    if part is None:
        raise ValueError(f"action {action!r} is not a mapping; it needs the parts {list(spec)}")
    return {part: action}


def from_parts(parts: Mapping[str, Any]) -> Any:
    """Return the plain array of an action with one part; a dict of the parts if it has several."""
    if len(parts) == 1:
        (array,) = parts.values()
        return array
    return dict(parts)


def random_action(spec: ActionSpec, rng: np.random.Generator) -> Parts:
    """Draw all parts of an action uniformly, in their order."""
    return {part: _random_part(one, rng) for part, one in spec.items()}


def _random_part(spec: ArraySpec, rng: np.random.Generator) -> NDArray[Any]:
    if spec.is_discrete:
        return np.asarray(rng.integers(int(spec.high) + 1), spec.dtype)
    return rng.uniform(spec.low, spec.high, spec.shape).astype(spec.dtype)


def play_script(
    script: Script,
    player: Player,
    expert_command: Callable[[Player], Any],
    rng: np.random.Generator,
) -> None:
    """Set the action of one player for the next step.

    Args:
        script: How the action is chosen.
        player: The player.
        expert_command: Returns the command of the player's expert; called for `Script.expert` only.
        rng: Random generator of the game.
    """
    if script is Script.idle:
        player.body.rest()
    elif script is Script.random:
        player.body.act(random_action(player.body.action_spec, rng))
    else:
        player.body.act(player.body.encode(expert_command(player)))


_LOG = logging.getLogger(__name__)

Observation = dict[str, NDArray[Any]]


class Outcome(NamedTuple):
    """The result of one step.

    Attributes:
        terms: Unweighted reward terms by player and name.
        terminated: Whether the episode has ended by the rules.
        truncated: Whether the time is up, or the simulation is not finite any more.
        eliminated: Names of the players for whom the episode has ended.
        solved: Whether the goal of the task is reached, by player; empty for a task without a goal.
        bodies: `Body.info` by player; empty for a body that reports nothing.
    """

    terms: dict[str, dict[str, float]]
    terminated: bool
    truncated: bool
    eliminated: frozenset[str] = frozenset()
    solved: Mapping[str, bool] = MappingProxyType({})
    bodies: Mapping[str, Mapping[str, float]] = MappingProxyType({})

    @property
    def done(self) -> bool:
        """Whether the episode has ended for all players."""
        return self.terminated or self.truncated

    def terminated_for(self, player: str) -> bool:
        """Return whether the episode has ended by the rules for one player."""
        return self.terminated or player in self.eliminated


class Game:
    """One task in one world.

    Attributes:
        cfg: The configuration.
        world: The world.
        task: The rules.
        players: All players, team by team.
        actors: The players whose actions are given to `step`; the others follow a script.
        senses: The senses of each player by player name.
        steps: Steps since the last reset.
        max_steps: Steps after which an episode is truncated.
        eliminated: Names of the players for whom this episode has ended.
        built: All objects that it consisted of when it was built, see `Snapshot`.

    Args:
        cfg: What to play.

    Raises:
        ValueError: If the configuration is impossible; the message names the value and the choices.
    """

    def __init__(self, cfg: GameCfg) -> None:
        cfg.check()
        self.cfg = cfg
        self.max_steps = cfg.max_steps
        self._rng: np.random.Generator | None = None
        self._build()

    def _build(self) -> None:
        """Build the world, the players, the task and the senses."""
        cfg = self.cfg
        self.world = World(cfg.playground, cfg.clock)
        self.senses: dict[str, dict[str, Sense]] = {}
        self.players = [
            self._make_player(name, team, number if team.shirt is None else team.shirt)
            for number, team in enumerate(cfg.teams)
            for name in player_names(team)
        ]
        self.actors = [player for player in self.players if player.team not in cfg.script]
        self.task = find_task(cfg.task.name)(cfg.task, self.world, self.players)
        self._weights = self.task.step_weights(cfg.task, cfg.clock)
        self.world.freeze()
        teams = {team.name: team for team in cfg.teams}
        for player in self.players:
            self.senses[player.name].update(self._make_senses(player, teams[player.team]))
        self.steps = 0
        self.eliminated: frozenset[str] = frozenset()
        self._experts: dict[str, Expert[Any]] = {}
        for team, script in cfg.script.items():
            if script is Script.expert:
                self._experts.update({p.name: self._make_expert(p) for p in self.team(team)})
        self.built = BuiltObjects(self)

    def _make_player(self, name: str, team: Team, shirt: int) -> Player:
        body = make_body(name, self.cfg.body_of(team.name), self.world, shirt)
        self.senses[name] = {}
        return Player(name, team.name, body, MappingProxyType(self.senses[name]))

    def _make_senses(self, player: Player, team: Team) -> dict[str, Sense]:
        names = self.task.senses if team.senses is None else team.senses
        return make_senses(player.body, names, self.cfg.senses_of(team.name), self.world)

    @property
    def weights(self) -> dict[str, float]:
        """Weight of each reward term in a step by its name, see `Task.rates`."""
        return self._weights

    @property
    def has_begun(self) -> bool:
        """Whether `reset` was called."""
        return self._rng is not None

    @property
    def rng(self) -> np.random.Generator | None:
        """The generator of the present episode; None before the first."""
        return self._rng

    def team(self, name: str) -> list[Player]:
        """Return the players of a team."""
        return [player for player in self.players if player.team == name]

    def _episode_rng(self) -> np.random.Generator:
        """Return the generator of the episode.

        Raises:
            RuntimeError: If `reset` was never called.
        """
        if self._rng is None:
            raise RuntimeError("no episode is running: call reset() first")
        return self._rng

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode; with a new world if the simulation is not finite any more.

        Args:
            rng: Generator of this episode: its start, its steps and its scripted players.
        """
        if self.broken:
            self.rebuild()
        self._rng = rng
        self.steps = 0
        self.eliminated = frozenset()
        self.world.reset(rng)
        self.task.reset(rng)
        for senses in self.senses.values():
            for sense in senses.values():
                sense.reset()
        self.world.refresh()
        for expert in self._experts.values():
            expert.reset()

    def step(self, actions: Mapping[str, Any]) -> Outcome:
        """Play one agent step: `command`, then `advance`."""
        self.command(actions)
        return self.advance()

    def command(self, actions: Mapping[str, Any]) -> None:
        """Set the actions of the actors for the next step, before anything moves.

        Args:
            actions: One action per actor, by player name: a mapping with a value for each part of
                its body's `action_spec`, or the plain array if there is one part. Actions of
                eliminated players are optional and ignored.

        Raises:
            ValueError: If an action is invalid or missing, or for a player that does not exist.
        """
        self._check_names(actions)
        for player in self.actors:
            if player.name in self.eliminated:
                player.body.rest()
                continue
            try:
                player.body.act(to_parts(player.body.action_spec, actions[player.name]))
            except ValueError as error:
                raise ValueError(f"{player.name}: {error}") from None

    def _check_names(self, actions: Mapping[str, Any]) -> None:
        names = [player.name for player in self.actors]
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions are {type(actions).__name__}, not a mapping with one for each of {names}"
            )
        if list(actions) == names:
            return
        unknown = sorted(set(actions) - set(names), key=str)
        if unknown:
            raise ValueError(f"actions for unknown agents {unknown}; there are {names}")
        missing = sorted(set(names) - set(actions) - self.eliminated)
        if missing:
            raise ValueError(f"no action for {missing}; each of {names} needs one")

    def advance(self) -> Outcome:
        """Simulate one agent step with the actions that were set last.

        A step after which the simulation is not finite any more truncates the episode. All its
        reward terms are 0, and it solves nothing.

        Raises:
            RuntimeError: If `reset` was never called.
        """
        rng = self._episode_rng()
        self._play_scripts()
        self.task.before_step(rng)
        self.world.step()
        self.steps += 1
        if broken := self.broken:
            return self._broken_outcome(broken)
        self.task.after_step(rng)
        terms = {player.name: self._terms(player) for player in self.players}
        if self.task.eliminates:
            self.eliminated |= {p.name for p in self.players if self.task.is_eliminated(p)}
        # the episode is over when only scripted players are left
        left = [p for p in self.actors or self.players if p.name not in self.eliminated]
        terminated = self.task.terminated() or not left
        truncated = self.steps >= self.max_steps
        return Outcome(
            terms, terminated, truncated, self.eliminated, self._solved(), self._body_info()
        )

    def _body_info(self) -> dict[str, dict[str, float]]:
        return {player.name: player.body.info() for player in self.players}

    def rebuild(self) -> None:
        """Build world, players, task and senses again, as in a new game: no episode has begun."""
        self.world.close()
        cfg = self.cfg
        vars(self).clear()
        Game.__init__(self, cfg)

    @property
    def broken(self) -> list[str]:
        """Names of the bodies and props with a state that is no longer finite.

        Bullet does not recover from that: `reset` and `Restoring` call `rebuild`.
        """
        bodies = [player.name for player in self.players if not player.body.is_finite]
        return bodies + self.world.broken_props

    def _broken_outcome(self, names: Sequence[str]) -> Outcome:
        """Return the outcome of a step after which the simulation is not finite; log the cause."""
        _LOG.warning(
            "step %d of %s: the simulation of %s is not finite or beyond any motion; "
            "the episode is truncated, the next one has a new world",
            self.steps,
            self.cfg.task.name,
            ", ".join(names),
        )
        terms = {player.name: dict.fromkeys(self.weights, 0.0) for player in self.players}
        solved = dict.fromkeys(terms, False) if self.task.has_goal() else {}
        return Outcome(terms, False, True, self.eliminated, solved, self._body_info())

    def _play_scripts(self) -> None:
        for team, script in self.cfg.script.items():
            for player in self.team(team):
                self.play_script(player, script)

    def play_script(self, player: Player, script: Script) -> None:
        """Set the action of a player for the next step by a script; an eliminated player rests.

        Raises:
            RuntimeError: If `reset` was never called.
            ValueError: If the script is `Script.expert` and the task has no expert.
        """
        script_now = Script.idle if player.name in self.eliminated else script
        play_script(script_now, player, self._expert_command, self._episode_rng())

    def _expert_command(self, player: Player) -> Any:
        expert = self.expert_of(player)
        return expert.act(self.observe(player, expert.reads))

    def expert_of(self, player: Player) -> Expert[Any]:
        """Return the expert of a player. It is made at the first call and reset with the game.

        Raises:
            ValueError: If the task has no expert, it needs a sense that the player has not, or it
                cannot play at this control rate.
        """
        if player.name not in self._experts:
            self._experts[player.name] = self._make_expert(player)
            self._experts[player.name].reset()
        return self._experts[player.name]

    def _make_expert(self, player: Player) -> Expert[Any]:
        expert = find_expert(self.cfg.task.name)
        check_expert(expert, player, self.world.clock)
        return expert(self.task, player)

    def _terms(self, player: Player) -> dict[str, float]:
        """Return the reward terms of a player; zeros if it was eliminated in an earlier step.

        Raises:
            SpecError: If the task returns others than it has weights for, or no numbers.
        """
        if player.name in self.eliminated:
            return dict.fromkeys(self.weights, 0.0)
        terms = self.task.reward(player)
        if not isinstance(terms, dict) or terms.keys() != self.weights.keys():
            found = sorted(terms) if isinstance(terms, dict) else type(terms).__name__
            raise SpecError(
                f"task {self.cfg.task.name}: reward() of {player.name} returned {found}, not a "
                f"dictionary with the terms of task.weights: {sorted(self.weights)}"
            )
        for name, value in terms.items():
            if type(value) is not float and not isinstance(value, (Real, np.bool_)):
                raise SpecError(
                    f"task {self.cfg.task.name}: reward term {name!r} of {player.name} is of type "
                    f"{type(value).__name__}, not a number"
                )
        return terms

    def _solved(self) -> dict[str, bool]:
        if not self.task.has_goal():
            return {}
        return {player.name: bool(self.task.solved(player)) for player in self.players}

    def observe(self, player: Player, names: Collection[str] | None = None) -> Observation:
        """Read senses of a player; within one step, every call returns the same values.

        Args:
            player: The player.
            names: Names of the senses to read, of those that the player has; None is all.
        """
        observation: Observation = {}
        for name, sense in self.senses[player.name].items():
            if names is None or name in names:
                observation.update(sense.read())
        return observation

    def reward_of(self, terms: Mapping[str, float]) -> float:
        """Return the reward: the weighted sum of the terms."""
        return sum(self.weights[name] * value for name, value in terms.items())

    def close(self) -> None:
        """Release the resources of the world."""
        self.world.close()


def player_names(team: Team) -> list[str]:
    """Return the names of a team's players: `striker` if there is one, else `red_0`, `red_1`."""
    if team.size == 1:
        return [team.name]
    return [f"{team.name}_{index}" for index in range(team.size)]


def refuse_closed(is_closed: bool) -> None:
    """Refuse the use of an environment that is closed.

    Raises:
        RuntimeError: If it is.
    """
    if is_closed:
        raise RuntimeError("the environment is closed; make a new one")


def describe_teams(game: Game) -> str:
    """Return teams, agents, what they sense and what they do, in one line, for a `repr`."""
    players = {player.team: player for player in reversed(game.actors)}  # the first of each team
    counts = Counter(player.team for player in game.actors)
    return "; ".join(
        f"{team} x {count}: {_described_player(game, players[team])}"
        for team, count in counts.items()
    )


def _described_player(game: Game, player: Player) -> str:
    keys = [key for sense in game.senses[player.name].values() for key in sense.specs]
    actions = ", ".join(
        f"{name} of {int(spec.high) + 1}" if spec.is_discrete else f"{name} {spec.shape}"
        for name, spec in player.body.action_spec.items()
    )
    return f"{', '.join(keys)} -> {actions}"

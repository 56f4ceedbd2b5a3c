"""One task in one world with its players and their senses: a game, in numpy.

`VecaEnv` and every other face (PettingZoo, Gymnasium) stand on this class.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.actions import to_parts
from veca_marl.envs.core.expert import Expert, find_expert
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.scripts import play_script
from veca_marl.envs.core.task import Player, Team, find_task
from veca_marl.envs.core.team import Script
from veca_marl.sim.body.family import make_body
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.senses import make_senses

_LOG = logging.getLogger(__name__)

Observation = dict[str, NDArray[Any]]


class Outcome(NamedTuple):
    """What one step did.

    Attributes:
        terms: Unweighted reward terms by player and name.
        terminated: The game is over by its rules.
        truncated: The time is up, or the simulation of a body made no sense any more.
        out: The players for whom it is over, though others may play on.
    """

    terms: dict[str, dict[str, float]]
    terminated: bool
    truncated: bool
    out: frozenset[str] = frozenset()

    @property
    def done(self) -> bool:
        """Whether it is over for everyone."""
        return self.terminated or self.truncated

    def terminated_for(self, player: str) -> bool:
        """Say whether the game is over by its rules for one player."""
        return self.terminated or player in self.out


class Game:
    """One task in one world.

    Attributes:
        world: Where it is played.
        task: The rules.
        players: Everyone, team by team.
        actors: Those whose actions come from outside; the others follow a script.
        senses: The senses of each player by player name.
        out: The names of those for whom this episode is over.
    """

    def __init__(self, cfg: GameCfg) -> None:
        cfg.check()
        self.cfg = cfg
        self.max_steps = round(cfg.task.max_seconds / cfg.clock.step_s)
        self._rng: np.random.Generator | None = None
        self._build()

    def _build(self) -> None:
        cfg, task_type = self.cfg, find_task(self.cfg.task.name)
        self.world = World(cfg.playground, cfg.clock)
        self.players = [
            self._make_player(name, team, number if team.shirt is None else team.shirt)
            for number, team in enumerate(cfg.teams)
            for name in player_names(team)
        ]
        self.actors = [player for player in self.players if player.team not in cfg.script]
        self.task = task_type(cfg.task, self.world, self.players)
        self.world.freeze()
        self.senses: dict[str, dict[str, Sense]] = {
            player.name: make_senses(
                player.body,
                task_type.senses if team.senses is None else team.senses,
                cfg.senses_of(team.name),
                self.world,
            )
            for team in cfg.teams
            for player in self.team(team.name)
        }
        self.steps = 0
        self.out: frozenset[str] = frozenset()
        self._experts: dict[str, Expert[Any]] = {}
        for team, script in cfg.script.items():
            if script is Script.expert:
                self._experts.update({p.name: self._make_expert(p) for p in self.team(team)})

    def _make_player(self, name: str, team: Team, shirt: int) -> Player:
        body = make_body(name, self.cfg.body_of(team.name), self.world, shirt)
        return Player(name, team.name, body)

    @property
    def weights(self) -> dict[str, float]:
        """What each reward term is worth."""
        return self.task.cfg.weights

    def team(self, name: str) -> list[Player]:
        """Return the players of a team."""
        return [player for player in self.players if player.team == name]

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode; in a new world with new players if the old one fell apart.

        Args:
            rng: All randomness of this episode, at its start and in its steps.
        """
        self._rng = rng
        if self._broken():
            self.world.close()
            self._build()
        self.steps = 0
        self.out = frozenset()
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
        """Tell the actors what to do, before anything moves.

        Args:
            actions: One action per actor, by player name: a mapping with a value for each part of
                its body's `action_spec`, or the plain array if there is one part. Actions of
                players that are out may be there and are ignored.

        Raises:
            ValueError: If an action is impossible, or the actors are others.
        """
        self._check_names(actions)
        for player in self.actors:
            if player.name in self.out:
                player.body.rest()
                continue
            try:
                player.body.act(to_parts(player.body.action_spec, actions[player.name]))
            except ValueError as error:
                raise ValueError(f"{player.name}: {error}") from None

    def _check_names(self, actions: Mapping[str, Any]) -> None:
        names = [player.name for player in self.actors]
        if list(actions) == names:
            return
        unknown = sorted(set(actions) - set(names))
        if unknown:
            raise ValueError(f"actions for unknown agents {unknown}; there are {names}")
        missing = sorted(set(names) - set(actions) - self.out)
        if missing:
            raise ValueError(f"no action for {missing}; each of {names} needs one")

    def advance(self) -> Outcome:
        """Simulate one agent step with the actions that were set last.

        Raises:
            RuntimeError: If `reset` was never called.
        """
        rng = self._episode_rng()
        self._play_scripts()
        self.task.before_step(rng)
        self.world.step()
        self.task.after_step(rng)
        self.steps += 1
        terms = {player.name: self._terms(player) for player in self.players}
        if self.task.eliminates:
            self.out |= {player.name for player in self.players if self.task.is_eliminated(player)}
        terminated = self.task.terminated() or len(self.out) == len(self.players)
        truncated = self.steps >= self.max_steps or self._fell_apart()
        return Outcome(terms, terminated, truncated, self.out)

    def _episode_rng(self) -> np.random.Generator:
        if self._rng is None:
            raise RuntimeError("no episode is running: call reset() before the first step")
        return self._rng

    def _play_scripts(self) -> None:
        for team, script in self.cfg.script.items():
            for player in self.team(team):
                self.play_script(player, script)

    def play_script(self, player: Player, script: Script) -> None:
        """Set the action of a player for the next step by a script; one that is out rests.

        Raises:
            RuntimeError: If `reset` was never called.
            ValueError: If the script is `Script.expert` and the task has no expert.
        """
        script_now = Script.idle if player.name in self.out else script
        play_script(script_now, player, self._expert_command, self._episode_rng())

    def _expert_command(self, player: Player) -> Any:
        return self.expert_of(player).act(self.observe(player))

    def expert_of(self, player: Player) -> Expert[Any]:
        """Return the expert of a player. It is made at the first call and reset with the game.

        Raises:
            ValueError: If the task has no expert.
        """
        if player.name not in self._experts:
            self._experts[player.name] = self._make_expert(player)
            self._experts[player.name].reset()
        return self._experts[player.name]

    def _make_expert(self, player: Player) -> Expert[Any]:
        return find_expert(self.cfg.task.name)(self.task, player)

    def _terms(self, player: Player) -> dict[str, float]:
        """Return what a player earns; nothing if it was out before this step."""
        if player.name in self.out:
            return dict.fromkeys(self.weights, 0.0)
        return self.task.reward(player)

    def _fell_apart(self) -> bool:
        """Log which body's simulation has gone non-finite; say whether one has."""
        broken = self._broken()
        if broken:
            _LOG.warning(
                "step %d of %s: the simulation of %s is not finite any more; "
                "the episode is truncated, the next one has a new world",
                self.steps,
                self.cfg.task.name,
                ", ".join(broken),
            )
        return bool(broken)

    def _broken(self) -> list[str]:
        return [player.name for player in self.players if not player.body.is_finite]

    def observe(self, player: Player) -> Observation:
        """Read all senses of a player; within one step, every call returns the same values."""
        observation: Observation = {}
        for sense in self.senses[player.name].values():
            observation.update(sense.read())
        return observation

    def pay(self, terms: dict[str, float]) -> float:
        """Return the reward: the weighted sum of the terms."""
        return sum(self.weights[name] * value for name, value in terms.items())

    def close(self) -> None:
        """Give the world's resources back."""
        self.world.close()


def player_names(team: Team) -> list[str]:
    """Name the players of a team: `striker` if alone, else `red_0`, `red_1`, ..."""
    if team.size == 1:
        return [team.name]
    return [f"{team.name}_{index}" for index in range(team.size)]

"""One task in one world with its players and their senses: a game, in numpy.

`VecaEnv` and every other face (PettingZoo, Gymnasium) stand on this class.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import veca_marl.envs.tasks  # noqa: F401  registers the tasks
from veca_marl.envs.task import Player, TaskCfg, Team, find_task
from veca_marl.sim.bodies.base import BodyCfg
from veca_marl.sim.bodies.family import make_body
from veca_marl.sim.bodies.walker import WalkerCfg
from veca_marl.sim.playground import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg, give_senses
from veca_marl.sim.senses.base import Sense
from veca_marl.sim.world import ClockCfg, World

_LOG = logging.getLogger(__name__)

Observation = dict[str, NDArray[Any]]


@dataclass
class GameCfg:
    """Everything a game is made of.

    Attributes:
        task: The rules and their numbers.
        playground: Where it is played.
        body: What the players are.
        senses: How well they perceive.
        clock: How time passes.
    """

    task: TaskCfg = field(default_factory=TaskCfg)
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = field(default_factory=WalkerCfg)
    senses: SensesCfg = field(default_factory=SensesCfg)
    clock: ClockCfg = field(default_factory=ClockCfg)


class Outcome(NamedTuple):
    """What one step did.

    Attributes:
        terms: Unweighted reward terms by player and name.
        terminated: The game is over by its rules.
        truncated: The time is up, or the simulation of a body made no sense any more.
    """

    terms: dict[str, dict[str, float]]
    terminated: bool
    truncated: bool


class Game:
    """One task in one world.

    Attributes:
        world: Where it is played.
        task: The rules.
        players: Everyone, team by team.
        senses: The senses of each player by player name.
    """

    def __init__(self, cfg: GameCfg) -> None:
        self.cfg = cfg
        self.max_steps = round(cfg.task.max_seconds / cfg.clock.step_s)
        self._build()

    def _build(self) -> None:
        cfg, task_type = self.cfg, find_task(self.cfg.task.name)
        self.world = World(cfg.playground, cfg.clock)
        self.players = [
            Player(name, team.name, make_body(name, cfg.body, self.world, shirt))
            for shirt, team in enumerate(task_type.teams)
            for name in player_names(team)
        ]
        self.task = task_type(cfg.task, self.world, self.players)
        self.world.freeze()
        self.senses: dict[str, dict[str, Sense]] = {
            player.name: give_senses(player.body, task_type.senses, cfg.senses, self.world)
            for player in self.players
        }
        for senses in self.senses.values():
            self.world.after_substep.extend(sense.substep for sense in senses.values())
        self.steps = 0

    @property
    def weights(self) -> dict[str, float]:
        """What each reward term is worth."""
        return self.task.cfg.weights

    def team(self, name: str) -> list[Player]:
        """Return the players of a team."""
        return [player for player in self.players if player.team == name]

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode; in a new world with new players if the old one fell apart."""
        if self._broken():
            self.world.close()
            self._build()
        self.steps = 0
        self.world.reset(rng)
        self.task.reset(rng)
        for senses in self.senses.values():
            for sense in senses.values():
                sense.reset()
        self.world.refresh()

    def step(self, actions: dict[str, NDArray[Any]], rng: np.random.Generator) -> Outcome:
        """Play one agent step: `command`, then `advance`."""
        self.command(actions)
        return self.advance(rng)

    def command(self, actions: dict[str, NDArray[Any]]) -> None:
        """Tell all players what to do, before anything moves.

        Args:
            actions: One action row per player, by player name, as its body's `action_spec` says.

        Raises:
            ValueError: If an action is impossible, or the players are others.
        """
        names = [player.name for player in self.players]
        if set(actions) != set(names):
            raise ValueError(f"actions for {sorted(actions)}; the players are {names}")
        for player in self.players:
            try:
                player.body.act(actions[player.name])
            except ValueError as error:
                raise ValueError(f"{player.name}: {error}") from None

    def advance(self, rng: np.random.Generator) -> Outcome:
        """Let one agent step pass, with the players doing what they were told last.

        Args:
            rng: The game's source of randomness.
        """
        self.task.before_step(rng)
        self.world.step()
        self.task.after_step(rng)
        self.steps += 1
        terms = {player.name: self.task.reward(player) for player in self.players}
        truncated = self.steps >= self.max_steps or self._fell_apart()
        return Outcome(terms, self.task.terminated(), truncated)

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
        """Read all senses of a player. Call it once per step: reading the ears advances them."""
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

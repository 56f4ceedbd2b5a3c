"""What a game is made of: rules, place, bodies, senses, and what single teams have otherwise."""

from __future__ import annotations

from dataclasses import dataclass, field

from veca_marl.envs.core.expert import find_expert
from veca_marl.envs.core.task import TaskCfg, Team, find_task
from veca_marl.envs.core.team import Script, TeamCfg
from veca_marl.sim.body.base import BodyCfg
from veca_marl.sim.body.walker.walker import WalkerCfg
from veca_marl.sim.physics.playground import PlaygroundCfg
from veca_marl.sim.physics.world import ClockCfg
from veca_marl.sim.senses import SensesCfg

FLOOR_OF_A_PLAYER_M2 = 1.0  # to stand, turn and be placed apart from others


@dataclass
class GameCfg:
    """Everything a game is made of.

    Attributes:
        task: The rules and their numbers.
        playground: Where it is played.
        body: What the players are.
        senses: How well they perceive.
        clock: How time passes.
        team: What single teams have otherwise, by name.
        script: Who plays for the teams that take no actions from outside, by name.
    """

    task: TaskCfg = field(default_factory=TaskCfg)
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = field(default_factory=WalkerCfg)
    senses: SensesCfg = field(default_factory=SensesCfg)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    script: dict[str, Script] = field(default_factory=dict)

    @property
    def teams(self) -> tuple[Team, ...]:
        """Who plays."""
        return find_task(self.task.name).teams_of(self.task)

    def body_of(self, team: str) -> BodyCfg:
        """Return what the players of a team are."""
        own = self.team.get(team)
        return self.body if own is None or own.body is None else own.body

    def senses_of(self, team: str) -> SensesCfg:
        """Return how well the players of a team perceive."""
        own = self.team.get(team)
        return self.senses if own is None else own.senses.change(self.senses)

    def check(self) -> None:
        """Refuse choices for teams that do not play, and more players than there is floor for.

        Raises:
            ValueError: If there are any, if no team takes actions, or if a team is scripted by the
                expert of a task that has none.
        """
        names = [team.name for team in self.teams]
        for key, asked in (("team", self.team), ("script", self.script)):
            unknown = sorted(set(asked) - set(names))
            if unknown:
                raise ValueError(f"{key}: {self.task.name} has no teams {unknown}; it has {names}")
        if set(self.script) == set(names):
            raise ValueError(f"script: all teams of {self.task.name} are scripted: {names}")
        if Script.expert in self.script.values():
            find_expert(self.task.name)
        players = sum(team.size for team in self.teams)
        holds = int(self.playground.floor_m2 / FLOOR_OF_A_PLAYER_M2)
        if players > holds:
            raise ValueError(
                f"{self.task.name}: {players} players are too many for playground "
                f"{self.playground.name!r}, which holds {holds} "
                f"({FLOOR_OF_A_PLAYER_M2} m2 of floor each)"
            )

"""The configuration of a game: task, playground, bodies, senses, clock, and teams that differ."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum

from veca_marl.envs.core.expert import find_expert
from veca_marl.envs.core.task import TaskCfg, Team, check_body, check_size, find_task
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg
from veca_marl.sim.senses import SensesCfg


@dataclass
class TeamCfg:
    """Body and senses of one team.

    Attributes:
        body: Body of its players; None is as for all teams.
        senses: Senses of its players; those without settings here are as for all teams.
    """

    body: BodyCfg | None = None
    senses: SensesCfg = field(default_factory=SensesCfg)

    def with_waveform(self) -> TeamCfg:
        """Return this team with the samples at the ears, if it has an audio setting of its own."""
        if self.senses.audio is None:
            return self
        audio = replace(self.senses.audio, waveform=True)
        return replace(self, senses=replace(self.senses, audio=audio))


class Script(Enum):
    """How the game chooses the actions of a scripted team, which is not part of the specs.

    Attributes:
        expert: By the expert of the task.
        random: Uniformly, with the generator of the episode.
        idle: Its players rest.
    """

    expert = "expert"
    random = "random"
    idle = "idle"


FLOOR_OF_A_PLAYER_M2 = 1.0  # in which a player can stand, turn and be placed apart from others


@dataclass
class GameCfg:
    """The configuration of a game.

    Attributes:
        task: The rules and their parameters.
        playground: Rooms and furniture.
        body: Body of the players.
        senses: Quality of their senses.
        clock: Time steps.
        team: Bodies and senses of teams that differ from the above, by team name.
        script: How the actions of scripted teams are chosen, by team name.
        global_state: Whether the TorchRL environment has the key ``state``, see `GlobalState`.
    """

    task: TaskCfg = field(default_factory=TaskCfg)
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = field(default_factory=WalkerCfg)
    senses: SensesCfg = field(default_factory=SensesCfg.complete)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    script: dict[str, Script] = field(default_factory=dict)
    global_state: bool = False

    @property
    def teams(self) -> tuple[Team, ...]:
        """The teams of the task."""
        return find_task(self.task.name).teams_of(self.task)

    @property
    def max_steps(self) -> int:
        """Number of steps after which an episode is truncated."""
        return round(self.task.max_seconds / self.clock.step_s)

    def body_of(self, team: str) -> BodyCfg:
        """Return the body of the players of a team."""
        own = self.team.get(team)
        return self.body if own is None or own.body is None else own.body

    def senses_of(self, team: str) -> SensesCfg:
        """Return the quality of the senses of a team."""
        own = self.team.get(team)
        return self.senses if own is None else self.senses.replaced_by(own.senses)

    def with_waveform(self) -> GameCfg:
        """Return this game with the samples at the ears among what hearing players observe."""
        audio = replace(self.senses.of("audio"), waveform=True)
        team = {name: own.with_waveform() for name, own in self.team.items()}
        return replace(self, senses=replace(self.senses, audio=audio), team=team)

    def check(self) -> None:
        """Check the duration, the teams, the scripts, the bodies, the playground and the clock.

        Raises:
            ValueError: If an episode has no step, a team does not exist or has no players, all
                teams are scripted, the task has no expert for a script, or a body, the playground
                or the clock does not fit.
        """
        self._check_duration()
        self._check_sizes()
        self._check_teams([team.name for team in self.teams])
        self.check_bodies()
        self.check_playground()
        self.check_clock()

    def check_bodies(self) -> None:
        """Check that the task can be played with the bodies of all teams.

        Raises:
            ValueError: If a body is of another kind or size than it needs, or lacks a verb or a
                voice.
        """
        task = find_task(self.task.name)
        for team in self.teams:
            body = self.body_of(team.name)
            check_body(team.name, body, task.body_cfg, task.verbs, task.needs_voice)
            check_size(team.name, body.growth, task.ages_months)

    def check_playground(self) -> None:
        """Check that the task and all its players fit into the playground.

        Raises:
            ValueError: If the task cannot be played there, the floor is too small, or a distance of
                the task does not fit the size of a body.
        """
        task = find_task(self.task.name)
        task.check_playground(self.task, self.playground)
        self._check_floor()
        bodies = {team.name: self.body_of(team.name) for team in self.teams}
        task.check_distances(self.task, self.playground, bodies)

    def check_clock(self) -> None:
        """Check that the numbers of the task fit the time steps.

        Raises:
            ValueError: If something moves too far in a step, or is shorter than one.
        """
        find_task(self.task.name).check_clock(self.task, self.clock)

    def _check_duration(self) -> None:
        if self.max_steps < 1:
            raise ValueError(
                f"task.max_seconds={self.task.max_seconds:g} is no step: a step lasts "
                f"{self.clock.step_s:g} s (clock.control_rate_hz={self.clock.control_rate_hz:g})"
            )

    def _check_sizes(self) -> None:
        for team in self.teams:
            if team.size < 1:
                raise ValueError(
                    f"team {team.name!r} of {self.task.name} has size={team.size}; it must be at "
                    "least 1"
                )

    def _check_teams(self, names: list[str]) -> None:
        for key, asked in (("team", self.team), ("script", self.script)):
            unknown = sorted(set(asked) - set(names))
            if unknown:
                raise ValueError(f"{key}: {self.task.name} has no teams {unknown}; it has {names}")
        if set(self.script) == set(names):
            raise ValueError(f"script: all teams of {self.task.name} are scripted: {names}")
        if Script.expert in self.script.values():
            find_expert(self.task.name)

    def _check_floor(self) -> None:
        players = sum(team.size for team in self.teams)
        holds = int(self.playground.floor_m2 / FLOOR_OF_A_PLAYER_M2)
        if players > holds:
            raise ValueError(
                f"{self.task.name}: {players} players are too many for playground "
                f"{self.playground.name!r}, which holds {holds} "
                f"({FLOOR_OF_A_PLAYER_M2} m2 of floor each)"
            )

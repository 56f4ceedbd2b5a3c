"""The typed root of the configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from omegaconf import MISSING

from veca_marl.algos.algorithm import AlgorithmCfg
from veca_marl.algos.selfplay.self_play import SelfPlayCfg
from veca_marl.algos.training.collect import CollectCfg
from veca_marl.algos.training.evaluation import EvalCfg
from veca_marl.algos.training.loggers import LoggerKind, check_installed
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TaskCfg
from veca_marl.envs.core.team import Script, TeamCfg
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg
from veca_marl.sim.senses import SensesCfg


@dataclass
class LogCfg:
    """What a run leaves behind beside metrics.csv, evaluations.csv and checkpoints.

    Attributes:
        logger: Where numbers go: csv, tensorboard, wandb, mlflow, several of them, or none.
        progress_bar: A progress bar while training.
        video: An episode of the trained policy with the agent's own sound, at the end.
        keep_checkpoints: How many of the latest checkpoints stay beside the best one.
    """

    logger: list[LoggerKind] = field(
        default_factory=lambda: [LoggerKind.csv, LoggerKind.tensorboard]
    )
    progress_bar: bool = True
    video: bool = True
    keep_checkpoints: int = 3

    def __post_init__(self) -> None:
        for kind in self.logger:
            check_installed(kind)
        if self.keep_checkpoints < 1:
            raise ValueError(
                f"log.keep_checkpoints must be at least 1, got {self.keep_checkpoints}"
            )


@dataclass
class Config:
    """Everything a run depends on.

    Attributes:
        task: The rules and their numbers: ``+task=KickTheBall``.
        playground: Where it is played.
        body: What the players are.
        senses: How well they perceive.
        clock: How time passes.
        team: What single teams have otherwise: ``+body@team.defender.body=walker_discrete``,
            ``+senses/vision@team.defender.senses.vision=blind``.
        opponent: Teams that do not learn and who plays for them: expert, random, idle, or what
            another run learnt: ``opponent.defender=expert``, ``opponent.defender=runs/...``.
        warm_start: Teams that begin with what another run has learnt, of this task or another one
            with the same senses and actions, and its folder or a checkpoint of it:
            ``warm_start.attacker=runs/...``.
        algo: The learning algorithm and its numbers.
        learner: The same for single teams: ``+algo@learner.attacker=mappo``.
        self_play: Which teams learn against past selves.
        collect: How experience is gathered.
        eval: When and how the policy is evaluated.
        log: What is written down.
        seed: Everything random follows from it.
        device: Where networks learn: cpu, cuda, cuda:1, ...
        threads: Torch threads of the learner; None for all cores.
        total_frames: Frames of experience.
        max_minutes: Stop after the stage in which this time runs out; None for no limit.
        resume: The folder of a run to continue instead of starting one.
        plugins: Packages that add tasks, bodies, presets and more, see `veca_marl.plugins`.
    """

    task: TaskCfg = MISSING
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = MISSING
    senses: SensesCfg = field(default_factory=SensesCfg)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    opponent: dict[str, str] = field(default_factory=dict)
    warm_start: dict[str, str] = field(default_factory=dict)
    algo: AlgorithmCfg = MISSING
    learner: dict[str, AlgorithmCfg] = field(default_factory=dict)
    self_play: SelfPlayCfg = field(default_factory=SelfPlayCfg)
    collect: CollectCfg = field(default_factory=CollectCfg)
    eval: EvalCfg = field(default_factory=EvalCfg)
    log: LogCfg = field(default_factory=LogCfg)
    seed: int = 0
    device: str = "cpu"
    threads: int | None = None
    total_frames: int = 122_880
    max_minutes: float | None = None
    resume: str | None = None
    plugins: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for team, who in self.opponent.items():
            _check_opponent(team, who)
        if self.total_frames < 1:
            raise ValueError(f"total_frames must be at least 1, got {self.total_frames}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.max_minutes is not None and not self.max_minutes > 0:
            raise ValueError(f"max_minutes must be positive, got {self.max_minutes}")
        for algorithm in (self.algo, *self.learner.values()):
            algorithm.check_batch(self.collect.frames)
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads must be at least 1, got {self.threads}")

    @property
    def game(self) -> GameCfg:
        """What the environments are made from."""
        return GameCfg(
            self.task,
            self.playground,
            self.body,
            self.senses,
            self.clock,
            self.team,
            {team: Script(who) for team, who in self.opponent.items() if who in _SCRIPTS},
        )

    def check_teams(self) -> None:
        """Refuse what is said of teams that are not there, or not there to learn.

        Raises:
            ValueError: If there are any, or if nobody learns.
        """
        teams = [team.name for team in self.game.teams]
        learn = [team for team in teams if team not in self.opponent]
        for key, asked, choices in (
            ("opponent", self.opponent, teams),
            ("learner", self.learner, learn),
            ("warm_start", self.warm_start, learn),
            ("self_play.teams", self.self_play.teams, learn),
        ):
            unknown = sorted(set(asked) - set(choices))
            if unknown:
                raise ValueError(f"{key}: no {unknown} in {self.task.name}; choices: {choices}")
        if not learn:
            raise ValueError(f"opponent: nobody learns: all of {teams} are opponents")

    @property
    def frozen(self) -> dict[str, Path]:
        """Teams that are played by what another run learnt, and where that is."""
        return {team: Path(who) for team, who in self.opponent.items() if who not in _SCRIPTS}


_SCRIPTS = tuple(script.value for script in Script)


def _check_opponent(team: str, who: str) -> None:
    if who not in _SCRIPTS and not Path(who).exists():
        raise ValueError(
            f"opponent.{team}={who}: choices: {', '.join(_SCRIPTS)}, the folder of a run, "
            "a checkpoint"
        )

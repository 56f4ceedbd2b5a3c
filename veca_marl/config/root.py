"""The typed root of the configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from omegaconf import MISSING

from veca_marl.algos.algorithm import AlgorithmCfg
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.intrinsic import IntrinsicCfg
from veca_marl.algos.reporting.loggers import LoggerKind
from veca_marl.algos.selfplay.self_play import SelfPlayCfg
from veca_marl.config.experiment import ExperimentCfg
from veca_marl.envs.core.game_cfg import GameCfg, Script, TeamCfg
from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg
from veca_marl.sim.senses import SensesCfg


@dataclass
class LogCfg:
    """Outputs of a run beside its checkpoints.

    Attributes:
        logger: Where metrics are written: any of csv, tensorboard, wandb and mlflow.
        progress_bar: A progress bar while training.
        video: Whether an episode of the trained policy is recorded at the end, with the sound at
            the ears of the agent.
        keep_checkpoints: Number of latest checkpoints that are kept beside the best one.
    """

    logger: list[LoggerKind] = field(
        default_factory=lambda: [LoggerKind.csv, LoggerKind.tensorboard]
    )
    progress_bar: bool = True
    video: bool = True
    keep_checkpoints: int = 3

    def __post_init__(self) -> None:
        if self.keep_checkpoints < 1:
            raise ValueError(
                f"log.keep_checkpoints must be at least 1, got {self.keep_checkpoints}"
            )


@dataclass
class Config:
    """Everything a run depends on.

    Attributes:
        task: The rules and their numbers: ``+task=KickTheBall``.
        playground: Rooms and furniture.
        body: The bodies of the agents.
        senses: Quality of each sense.
        clock: Time step and control rate.
        team: Bodies and senses of single teams that differ from the common ones:
            ``+body@team.defender.body=walker_discrete``,
            ``+senses/vision@team.defender.senses.vision=blind``.
        opponent: Teams that do not learn, and what selects their actions: expert, random, idle, or
            the policy of another run: ``opponent.defender=expert``, ``opponent.defender=runs/...``.
        init_from: Teams that start from the parameters of another run (its folder or one of its
            checkpoints), of this task or of one with the same senses and actions:
            ``init_from.attacker=runs/...``, or ``runs/...:TEAM`` for a team of another name.
        init_encoders: Teams in which the encoder of a sense starts from another run, of any task
            where the sense has the same shape: ``init_encoders.attacker.vision=runs/...``.
        algo: The learning algorithm and its parameters.
        learner: The algorithm of single teams: ``+algo@learner.attacker=mappo``.
        intrinsic: Intrinsic rewards of all teams that learn: ``intrinsic=rnd``.
        team_intrinsic: Intrinsic rewards of single teams: ``+intrinsic@team_intrinsic.red=none``.
        self_play: Teams that learn against past policies of each other.
        collect: How experience is collected.
        eval: When and how policies are evaluated.
        log: Outputs of the run.
        experiment: The experiment that the run belongs to.
        seed: Seed of all random numbers.
        device: Device of the networks: cpu, cuda, cuda:1, ...
        threads: Torch threads of the learner; None for all cores.
        total_frames: Frames of experience: steps of worlds, summed over all worlds.
        max_minutes: Training stops after the stage in which this time is exceeded, which begins
            anew when the run is resumed; None for no limit.
        resume: Folder of a run that is continued.
        plugins: Packages that add tasks, bodies, presets and more, see `veca_marl.plugins`.
    """

    task: TaskCfg = MISSING
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = MISSING
    senses: SensesCfg = field(default_factory=SensesCfg)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    opponent: dict[str, str] = field(default_factory=dict)
    init_from: dict[str, str] = field(default_factory=dict)
    init_encoders: dict[str, dict[str, str]] = field(default_factory=dict)
    algo: AlgorithmCfg = MISSING
    learner: dict[str, AlgorithmCfg] = field(default_factory=dict)
    intrinsic: IntrinsicCfg = MISSING
    team_intrinsic: dict[str, IntrinsicCfg] = field(default_factory=dict)
    self_play: SelfPlayCfg = field(default_factory=SelfPlayCfg)
    collect: CollectCfg = field(default_factory=CollectCfg)
    eval: EvalCfg = field(default_factory=EvalCfg)
    log: LogCfg = field(default_factory=LogCfg)
    experiment: ExperimentCfg = field(default_factory=ExperimentCfg)
    seed: int = 0
    device: str = "cpu"
    threads: int | None = None
    total_frames: int = 122_880
    max_minutes: float | None = None
    resume: str | None = None
    plugins: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for team, player in self.opponent.items():
            _check_opponent(team, player)
        if self.total_frames < 1:
            raise ValueError(f"total_frames must be at least 1, got {self.total_frames}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.max_minutes is not None and not self.max_minutes > 0:
            raise ValueError(f"max_minutes must be positive, got {self.max_minutes}")
        for algorithm in (self.algo, *self.learner.values()):
            algorithm.check_batch(self.collect.all_worlds, self.collect.steps)
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads must be at least 1, got {self.threads}")

    @property
    def game(self) -> GameCfg:
        """The configuration of the environments."""
        return GameCfg(
            self.task,
            self.playground,
            self.body,
            self.senses,
            self.clock,
            self.team,
            {team: Script(player) for team, player in self.opponent.items() if player in _SCRIPTS},
        )

    def check_teams(self) -> None:
        """Check that entries by team name teams of the task, and learning ones where required.

        Raises:
            ValueError: If one does not, or if no team learns.
        """
        teams = [team.name for team in self.game.teams]
        learn = [team for team in teams if team not in self.opponent]
        for key, asked, choices in (
            ("opponent", self.opponent, teams),
            ("learner", self.learner, learn),
            ("init_from", self.init_from, learn),
            ("init_encoders", self.init_encoders, learn),
            ("team_intrinsic", self.team_intrinsic, learn),
            ("self_play.teams", self.self_play.teams, learn),
        ):
            unknown = sorted(set(asked) - set(choices))
            if unknown:
                raise ValueError(f"{key}: no {unknown} in {self.task.name}; choices: {choices}")
        if not learn:
            raise ValueError(f"opponent: no team learns: all of {teams} are opponents")

    @property
    def frozen(self) -> dict[str, Path]:
        """Teams with the policy of another run, and its folder or checkpoint."""
        return {
            team: Path(player) for team, player in self.opponent.items() if player not in _SCRIPTS
        }


_SCRIPTS = tuple(script.value for script in Script)


def _check_opponent(team: str, player: str) -> None:
    if player not in _SCRIPTS and not Path(player).exists():
        raise ValueError(
            f"opponent.{team}={player}: choices: {', '.join(_SCRIPTS)}, the folder of a run, "
            f"a checkpoint (a path that begins in {Path.cwd()}, or an absolute one)"
        )

"""The typed root of the configuration, and how it is put together from choices.

`compose` gives notebooks what the command line gives `train`: the same defaults, the same errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import hydra
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from veca_marl.algos.ppo.learner import PPOCfg
from veca_marl.algos.selfplay.self_play import SelfPlayCfg
from veca_marl.algos.training.collect import CollectCfg
from veca_marl.algos.training.evaluation import EvalCfg
from veca_marl.config.conf_dir import conf_dir
from veca_marl.config.errors import ConfigError, one_line
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS, TaskCfg, find_task
from veca_marl.envs.core.team import Script, TeamCfg
from veca_marl.sim.body.base import BodyCfg
from veca_marl.sim.body.humanoid.humanoid import HumanoidCfg
from veca_marl.sim.body.walker.walker import WalkerCfg
from veca_marl.sim.physics.playground import PlaygroundCfg
from veca_marl.sim.physics.world import ClockCfg
from veca_marl.sim.senses import SensesCfg

CONF = conf_dir()


@dataclass
class LogCfg:
    """What a run leaves behind beside metrics.csv, evaluations.csv and checkpoints.

    Attributes:
        tensorboard: Curves for TensorBoard.
        progress_bar: A progress bar while training.
        video: An episode of the trained policy with the agent's own sound, at the end.
        keep_checkpoints: How many of the latest checkpoints stay beside the best one.
    """

    tensorboard: bool = True
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
    """

    task: TaskCfg = MISSING
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    body: BodyCfg = MISSING
    senses: SensesCfg = field(default_factory=SensesCfg)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    opponent: dict[str, str] = field(default_factory=dict)
    warm_start: dict[str, str] = field(default_factory=dict)
    algo: PPOCfg = MISSING
    learner: dict[str, PPOCfg] = field(default_factory=dict)
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

    def __post_init__(self) -> None:
        for team, who in self.opponent.items():
            _check_opponent(team, who)
        if self.total_frames < 1:
            raise ValueError(f"total_frames must be at least 1, got {self.total_frames}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.max_minutes is not None and not self.max_minutes > 0:
            raise ValueError(f"max_minutes must be positive, got {self.max_minutes}")
        minibatches = max(cfg.minibatches for cfg in (self.algo, *self.learner.values()))
        if self.collect.frames < minibatches:
            raise ValueError(
                f"collect: a batch of {self.collect.frames} frames cannot be split into "
                f"algo.minibatches={minibatches}"
            )
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


def register_schemas() -> None:
    """Tell Hydra the types behind the YAML files."""
    store = ConfigStore.instance()
    schema = OmegaConf.structured(Config)
    # these take any key: the game knows its teams
    by_teams = ("team", "opponent", "warm_start", "learner")
    for by_team in by_teams:
        OmegaConf.set_struct(schema[by_team], False)
    store.store(name="schema", node=schema)
    store.store(group="schema/algo", name="ppo", node=PPOCfg)
    store.store(group="schema/body", name="walker", node=WalkerCfg)
    store.store(group="schema/body", name="humanoid", node=HumanoidCfg)
    for name, task in TASKS.items():
        store.store(group="schema/task", name=name, node=task.cfg_type())
    OmegaConf.register_new_resolver("run_folder", _run_folder, replace=True)


def compose(overrides: Sequence[str] = ()) -> Config:
    """Return the configuration that ``python -m veca_marl.train *overrides`` would train.

    Works anywhere: in a notebook, twice, inside a running Hydra application.

    Args:
        overrides: As on the command line, such as ``["+task=KickTheBall", "senses/audio=mono"]``.

    Raises:
        ConfigError: One line that names the wrong part and the choices.
    """
    return to_config(compose_node(overrides))


def compose_node(overrides: Sequence[str]) -> DictConfig:
    """Return what `compose` returns, still typed and changeable by name."""
    try:
        with _own_hydra():
            node: DictConfig = hydra.compose("config", overrides=list(overrides))
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(one_line(error)) from error
    return node


def to_config(node: DictConfig) -> Config:
    """Turn Hydra's node into dataclasses, which check their values.

    Raises:
        ConfigError: If there is no task, or a value is impossible.
    """
    if OmegaConf.is_missing(node, "task"):
        raise ConfigError(no_task())
    try:
        config = cast(Config, OmegaConf.to_object(node))
        find_task(config.task.name)
        _refuse_extra(config, "")
        config.check_teams()
    except (OmegaConfBaseException, ValueError) as error:
        raise ConfigError(one_line(error)) from error
    return config


def _refuse_extra(config: Any, path: str) -> None:
    """Raise `ValueError` for what ``+key=value`` added to a dataclass."""
    names = [f.name for f in fields(config)]
    for extra in sorted(set(vars(config)) - set(names)):
        raise ValueError(f"unknown key '{path}{extra}'; choices: {', '.join(sorted(names))}")
    for name in names:
        if is_dataclass(getattr(config, name)):
            _refuse_extra(getattr(config, name), f"{path}{name}.")


def no_task() -> str:
    """Say that a task must be chosen, and which there are."""
    return f"no task: add +task=NAME; choices: {', '.join(sorted(TASKS))}"


@contextmanager
def _own_hydra() -> Iterator[None]:
    """Compose beside whatever Hydra application is running."""
    holder = GlobalHydra.instance()
    running = holder.hydra
    holder.clear()
    try:
        with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
            yield
    finally:
        GlobalHydra.instance().hydra = running


def _run_folder(resume: str | None, task: str | None, now: str) -> str:
    """Name the folder of a run, before Hydra makes it."""
    if resume is not None:
        return resume
    if task is None:
        raise ConfigError(no_task())
    return f"runs/{task}/{now}"


register_schemas()

"""The typed root of the configuration, and the types behind its files as Hydra stores them.

Each registered task has a schema. A task without a file `conf/task/MyTask.yaml` has an entry of the
group `task` as well, so that ``+task=MyTask`` takes the defaults of its dataclass.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, OmegaConf

from veca_marl.algos.algorithm import ALGORITHMS, AlgorithmCfg
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.intrinsic.intrinsic_reward import INTRINSICS, NONE, IntrinsicCfg
from veca_marl.algos.networks.factory import NETWORKS
from veca_marl.algos.reporting import LoggerKind
from veca_marl.algos.selfplay import SelfPlayCfg
from veca_marl.config.experiment import ExperimentCfg
from veca_marl.config.overrides import conf_dirs
from veca_marl.envs.core.development import at_age, check_age
from veca_marl.envs.core.game_cfg import GameCfg, Script, TeamCfg
from veca_marl.envs.core.task import TASKS, TaskCfg
from veca_marl.policy_paths import policy_path
from veca_marl.sim.body import BODIES, BodyCfg
from veca_marl.sim.physics import PLAYGROUND_GENERATORS, ClockCfg, PlaygroundCfg
from veca_marl.sim.senses import SensesCfg


@dataclass
class LogCfg:
    """Outputs of a run beside its checkpoints.

    Attributes:
        logger: Where metrics are written: any of csv, tensorboard, wandb and mlflow.
        progress_bar: A progress bar while training.
        video: Whether an episode of the trained policy is recorded at the end, with the sound at
            the ears of the agent.
        episode: Whether the episode of the video is stored as a page as well, `episode.html`, which
            any browser opens from disk.
        keep_checkpoints: Number of latest checkpoints that are kept beside the best one.
    """

    logger: list[LoggerKind] = field(
        default_factory=lambda: [LoggerKind.csv, LoggerKind.tensorboard]
    )
    progress_bar: bool = True
    video: bool = True
    episode: bool = True
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
        global_state: Whether the environment has the key ``state``, what the simulator knows, for
            ``algo.network.critic=state``.
        development: Age in months, from 1 to 36, of bodies and senses, see
            `veca_marl.envs.core.development`; None for the body of 0.78 m with an adult's senses.
        opponent: Teams that do not learn, and what selects their actions: expert, random, idle, or
            the policy of another run: ``opponent.defender=expert``, ``opponent.defender=runs/...``.
        init_from: Teams that start from the parameters of another run (its folder or one of its
            checkpoints), of this task or of one with the same senses and actions:
            ``init_from.attacker=runs/...``, or ``runs/...:TEAM`` for a team of another name.
        init_encoders: Teams in which the encoder of a sense starts from another run, of any task
            where the sense has the same shape: ``init_encoders.attacker.vision=runs/...``.
        algo: The learning algorithm and its parameters.
        learner: The algorithm of single teams: ``+algo@learner.attacker=mappo``.
        demonstrations: Folder of recorded demonstrations that all teams learn from, as ``python -m
            veca_marl.demonstrations`` writes it; None for none.
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
    senses: SensesCfg = field(default_factory=SensesCfg.complete)
    clock: ClockCfg = field(default_factory=ClockCfg)
    team: dict[str, TeamCfg] = field(default_factory=dict)
    global_state: bool = False
    development: float | None = None
    opponent: dict[str, str] = field(default_factory=dict)
    init_from: dict[str, str] = field(default_factory=dict)
    init_encoders: dict[str, dict[str, str]] = field(default_factory=dict)
    algo: AlgorithmCfg = MISSING
    learner: dict[str, AlgorithmCfg] = field(default_factory=dict)
    demonstrations: str | None = None
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
        if self.development is not None:
            check_age(self.development)
        for team, player in self.opponent.items():
            _check_opponent(team, player)
        for sense in sorted(self.senses.unset):  # only in those of a team it means something
            raise ValueError(f"senses.{sense} is null: choose a preset with senses/{sense}=NAME")
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
        game = GameCfg(
            self.task,
            self.playground,
            self.body,
            self.senses,
            self.clock,
            self.team,
            {team: Script(player) for team, player in self.opponent.items() if player in _SCRIPTS},
            self.global_state,
        )
        return game if self.development is None else at_age(game, self.development)

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
            team: policy_path(player)
            for team, player in self.opponent.items()
            if player not in _SCRIPTS
        }


_SCRIPTS = tuple(script.value for script in Script)


def _check_opponent(team: str, player: str) -> None:
    try:
        path = policy_path(player)
    except ValueError as error:
        raise ValueError(f"opponent.{team}={player}: {error}") from error
    if player not in _SCRIPTS and not path.exists():
        raise ValueError(
            f"opponent.{team}={player}: choices: {', '.join(_SCRIPTS)}, zoo/NAME, the folder of a "
            f"run, a checkpoint (a path that begins in {Path.cwd()}, or an absolute one)"
        )


BY_TEAM = ("team", "opponent", "init_from", "init_encoders", "learner", "team_intrinsic")
"""Keys of the root that have the names of teams as their keys."""


def register_schemas() -> None:
    """Store the schemas of the root and of all registered entries, present and later ones."""
    store = ConfigStore.instance()
    store.store(name="schema", node=root_schema())
    _store_named("intrinsic", NONE, IntrinsicCfg)
    ALGORITHMS.listen(_store_algorithm)
    NETWORKS.listen(_store_network)
    INTRINSICS.listen(_store_intrinsic)
    BODIES.listen(_store_body)
    PLAYGROUND_GENERATORS.listen(_store_playground)
    TASKS.listen(_store_task_schema)


def root_schema() -> Any:
    """Return `Config` as a node that takes any team's name where teams are keys."""
    schema = OmegaConf.structured(Config)
    for key in BY_TEAM:
        OmegaConf.set_struct(schema[key], False)
    return schema


def body_types() -> dict[str, type[BodyCfg]]:
    """Return the dataclass of each kind of body."""
    return {name: body.cfg_type for name, body in BODIES.items()}


def store_tasks_without_file() -> None:
    """Store a group entry for each registered task that has no file `task/<name>.yaml`."""
    store = ConfigStore.instance()
    for name in TASKS:
        if not any((folder / "task" / f"{name}.yaml").is_file() for folder in conf_dirs()):
            entry = {"defaults": [{"/schema/task@task": name}, "_self_"], "task": {"name": name}}
            store.store(group="task", name=name, node=entry, package="_global_")


def _store_algorithm(name: str) -> None:
    """Store the schema of an algorithm; its network is chosen in the group ``algo/network``.

    An algorithm without a file ``algo/<name>.yaml`` has an entry of the group ``algo`` as well.
    """
    store = ConfigStore.instance()
    node = OmegaConf.structured(ALGORITHMS[name].cfg_type)
    defaults: list[Any] = [{"/schema/algo@_here_": name}]
    if "network" in node:
        defaults.append({"network": node.network.name})
        node.network = MISSING
    store.store(group="schema/algo", name=name, node=node)
    if not any((folder / "algo" / f"{name}.yaml").is_file() for folder in conf_dirs()):
        store.store(group="algo", name=name, node={"defaults": [*defaults, "_self_"]})


def _store_network(name: str) -> None:
    ConfigStore.instance().store(group="algo/network", name=name, node=NETWORKS[name].cfg_type)


def _store_intrinsic(name: str) -> None:
    """Store the schema of an intrinsic reward; without a file it can be chosen as well."""
    _store_named("intrinsic", name, INTRINSICS[name].cfg_type)


def _store_body(name: str) -> None:
    """Store the schema of a body; without a file it can be chosen as well."""
    _store_named("body", name, BODIES[name].cfg_type)


def _store_playground(name: str) -> None:
    """Store the schema of a generated playground; without a file it can be chosen as well."""
    _store_named("playground", name, PLAYGROUND_GENERATORS[name])


def _store_named(group: str, name: str, cfg_type: type) -> None:
    """Store a schema, and an entry of the group if there is no file ``<group>/<name>.yaml``."""
    store = ConfigStore.instance()
    store.store(group=f"schema/{group}", name=name, node=cfg_type)
    if not any((folder / group / f"{name}.yaml").is_file() for folder in conf_dirs()):
        entry = {"defaults": [{f"/schema/{group}@_here_": name}, "_self_"]}
        store.store(group=group, name=name, node=entry)


def _store_task_schema(name: str) -> None:
    ConfigStore.instance().store(group="schema/task", name=name, node=TASKS[name].cfg_type())

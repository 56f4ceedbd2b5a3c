"""Makes a trainer from a configuration: environments, algorithms, opponents, checkpoints, logs."""

from __future__ import annotations

import ctypes
import logging
import platform
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import torch
from omegaconf import DictConfig, OmegaConf

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg, check_engine
from veca_marl.algos.collection.host_limits import that_fits
from veca_marl.algos.evaluation.evaluators import evaluating_processes
from veca_marl.algos.networks.encoders import Precision
from veca_marl.algos.reporting import Reporter, check_installed, make_reporter
from veca_marl.algos.selfplay import Pool, SelfPlay
from veca_marl.algos.specs import TeamSpec, team_specs
from veca_marl.algos.storage import StorageNeeded, check_storage, runs_that_fit
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget
from veca_marl.algos.transfer import init_teams, load_actor
from veca_marl.config import Config, ConfigError, one_line
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.labelled import LabelledEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.plugins import load_plugins
from veca_marl.processes.cores import usable_cores
from veca_marl.runs.continuation import RESUMABLE, is_default
from veca_marl.runs.demonstrations import give_demonstrations
from veca_marl.runs.run_folder import RunFolder
from veca_marl.runs.served_worlds import ServedGames

# parameters of mallopt(3)
_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3
_LARGEST_ARRAY = 2**30  # bytes; larger arrays are returned when they are freed
_KEPT = 2**31 - 1  # bytes


def keep_freed_memory() -> bool:
    """Let the process keep the memory of freed arrays for the next ones.

    By default glibc returns large arrays to the system when they are freed; the next ones of that
    size, in the next gradient step, then fault in each page again. In float32 the update of the
    default network is 1.4 times as fast with it. Only glibc is adjusted: others are as they are.

    Returns:
        Whether the process uses glibc and it took the numbers.
    """
    if platform.libc_ver()[0] != "glibc":
        return False
    library = ctypes.CDLL(None)
    kept: bool = library.mallopt(_M_TRIM_THRESHOLD, _KEPT) == 1
    return kept and library.mallopt(_M_MMAP_THRESHOLD, _LARGEST_ARRAY) == 1


_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class GameFactory:
    """Makes the environments of a game, also in worker processes that have loaded no plug-ins.

    Attributes:
        game: The game.
        plugins: Packages that it needs, see `veca_marl.plugins`.
        labelled: Teams of which the environments say what their experts would do.
    """

    game: GameCfg
    plugins: tuple[str, ...] = ()
    labelled: tuple[str, ...] = ()

    def __call__(self, worlds: int, seed: int) -> VecaEnv:
        """Return `worlds` games in one environment."""
        load_plugins(self.plugins)
        if self.labelled:
            return LabelledEnv(self.game, worlds, seed, teams=self.labelled)
        return VecaEnv(self.game, worlds, seed)


def make_trainer(cfg: Config, folder: RunFolder | None = None) -> Trainer:
    """Return what trains as configured.

    Args:
        cfg: The configuration.
        folder: Folder of the run; None stores nothing.

    Raises:
        ConfigError: If the device does not exist, the package of a logger is not installed, no
            world can be made, what learning stores does not fit, or the frames end before a team
            learns.
        CheckpointError: If a run to continue or to load from does not fit.
    """
    _check_installed(cfg)
    device = _prepare_torch(cfg)
    specs = read_specs(cfg.game)
    learners = make_learners(cfg, specs, device)
    _log_storage(learners)
    give_demonstrations(cfg, folder, specs, learners)
    checkpoints = _make_checkpoints(cfg, folder, specs)
    collect, changed = that_fits(cfg.collect, specs)
    if changed:
        _LOG.warning(changed)
    trainer = _assemble(cfg, collect, learners, checkpoints)
    _warn_of_cut_episodes(trainer)
    if cfg.self_play.teams:
        trainer.matchmaking = _self_play(cfg, folder, learners)
    # a run that was killed before its first checkpoint starts from the beginning
    if cfg.resume is not None and not checkpoints.empty:
        trainer.resume(checkpoints.latest())
        _warn_of_idle_rest(trainer)
    else:
        _check_budget(trainer)
    return trainer


def _prepare_torch(cfg: Config) -> torch.device:
    """Set up memory, threads and seed of the process; return the device."""
    device = find_device(cfg.device)
    keep_freed_memory()
    if cfg.threads is not None:
        torch.set_num_threads(cfg.threads)
    torch.manual_seed(cfg.seed)
    return device


def _assemble(
    cfg: Config, collect: CollectCfg, learners: TeamLearners, checkpoints: Checkpoints
) -> Trainer:
    """Return the trainer; of a new run, with the parameters that it takes from other runs."""
    if cfg.resume is None or checkpoints.empty:
        init_teams(learners, cfg.init_from, cfg.init_encoders)
    make_env = _game_factory(cfg, collect, learners.need_experience)
    labelled = tuple(t for t, each in learners.algorithms.items() if each.needs_labels)
    return Trainer(
        make_env=make_env,
        make_training_env=_with_labels(make_env, labelled) if labelled else None,
        learners=learners,
        collect=collect,
        evaluation=cfg.eval,
        budget=Budget(cfg.total_frames, cfg.max_minutes),
        checkpoints=checkpoints,
        reporters=[],
        seed=cfg.seed,
        progress_bar=cfg.log.progress_bar,
        episode_steps=cfg.game.max_steps,
    )


def _self_play(cfg: Config, folder: RunFolder | None, learners: TeamLearners) -> SelfPlay:
    if folder is None:
        raise ConfigError("self_play.teams: past policies are stored in the folder of a run")
    return SelfPlay(cfg.self_play, learners, Pool(folder.pool), cfg.seed)


def _check_installed(cfg: Config) -> None:
    """Refuse to train where a package is missing; a stored run can be read there."""
    try:
        check_engine(cfg.collect.engine)
        for kind in cfg.log.logger:
            check_installed(kind)
    except ValueError as error:
        raise ConfigError(str(error)) from error


def _check_budget(trainer: Trainer) -> None:
    """Refuse a new run in which a team would learn nothing."""
    asked = trainer.budget.total_frames
    for team, numbers in trainer.learners.cfgs.items():
        frames = trainer.frames_to_learn(team)
        if not frames:
            raise ConfigError(
                f"total_frames={asked}: team {team!r} would not learn: in self-play the teams "
                f"learn in turns of eval.every_frames={trainer.evaluation.every_frames}"
            )
        try:
            numbers.check_budget(frames)
        except ValueError as error:
            raise ConfigError(f"total_frames={asked}: team {team!r}: {one_line(error)}") from error


def _warn_of_cut_episodes(trainer: Trainer) -> None:
    """Log that learning does not see the end of episodes that are longer than a stage."""
    stage = trainer.schedule.batches_per_stage * trainer.collect.steps
    if not trainer.learners.need_experience:
        return
    if trainer.episode_steps is not None and stage < trainer.episode_steps:
        _LOG.warning(
            "episodes last up to %d steps, but worlds start new ones every %d steps "
            "(eval.every_frames=%d, %d worlds): what comes later is not learnt from; choose larger "
            "eval.every_frames, or fewer worlds, such as collect=workers8",
            trainer.episode_steps,
            stage,
            trainer.evaluation.every_frames,
            trainer.collect.all_worlds,
        )


def _warn_of_idle_rest(trainer: Trainer) -> None:
    """Log which teams learn nothing in the rest of a run: it can still be completed.

    A replay buffer that is not in the checkpoint is filled again before the next update.
    """
    for team, algorithm in trainer.learners.algorithms.items():
        left = trainer.frames_to_learn(team)
        if left <= 0 or algorithm.exact_resume:
            continue
        try:
            trainer.learners.cfgs[team].check_budget(left)
        except ValueError as error:
            _LOG.warning(
                "team %r learns nothing more: from frame %d to total_frames=%d, %s",
                team,
                trainer.progress.frames,
                trainer.budget.total_frames,
                one_line(error),
            )


def _log_storage(learners: TeamLearners) -> None:
    """Log the memory and disk space that learning takes; refuse what does not fit."""
    try:
        lines = check_storage(learners.storage_needed)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    for line in lines:
        _LOG.info(line)


def _make_checkpoints(
    cfg: Config, folder: RunFolder | None, specs: dict[str, TeamSpec]
) -> Checkpoints:
    plain = OmegaConf.to_container(OmegaConf.structured(cfg), enum_to_str=True)
    return Checkpoints(
        None if folder is None else folder.checkpoints,
        Identity(cfg.task.name, specs),
        cast(dict[str, Any], plain),
        cfg.log.keep_checkpoints,
        RESUMABLE,
        lambda key: is_default(cfg, key),
    )


def _game_factory(
    cfg: Config, collect: CollectCfg, needs_experience: bool
) -> GameFactory | ServedGames:
    """Return what makes the environments: on this machine, or on a server.

    Raises:
        ConfigError: If the server cannot be reached, or has another game, too few worlds or too few
            places for the processes of the run.
    """
    if collect.server is None:
        return GameFactory(cfg.game, tuple(cfg.plugins))
    served = ServedGames(collect.server, collect.key)
    processes, worlds = collect.processes_on(usable_cores()), cfg.eval.worlds
    collecting = max(processes, 1)
    evaluating = max(evaluating_processes(collect.groups, processes, worlds), 1)
    most_worlds = max(collect.all_worlds // collecting, worlds)
    served.check(cfg.game, most_worlds, collecting * needs_experience + evaluating)
    return served


def _with_labels(factory: GameFactory | ServedGames, teams: tuple[str, ...]) -> GameFactory:
    """Return what makes environments that say what the experts of teams would do.

    Raises:
        ConfigError: If the worlds are on a server.
    """
    if isinstance(factory, ServedGames):
        raise ConfigError(
            f"collect.server={factory.address} gives no labels of experts, which the algorithms of "
            f"{list(teams)} learn from: play the worlds on this machine"
        )
    return replace(factory, labelled=teams)


def make_learners(cfg: Config, specs: dict[str, TeamSpec], device: torch.device) -> TeamLearners:
    """Return the algorithms of all teams; teams with an opponent from another run are frozen.

    Raises:
        CheckpointError: If an opponent cannot be loaded.
        ConfigError: If an algorithm cannot be made as configured.
    """
    actors = {team: load_actor(path, team, specs[team]) for team, path in cfg.frozen.items()}
    intrinsic = {team: cfg.team_intrinsic.get(team, cfg.intrinsic) for team in specs}
    try:
        return TeamLearners(specs, cfg.algo, device, cfg.learner, actors, intrinsic)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def read_specs(game: GameCfg) -> dict[str, TeamSpec]:
    """Return the arrays of each team; one world is built and closed for it.

    Raises:
        ConfigError: If no world can be made.
    """
    try:
        env = VecaEnv(game, 1, 0)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    specs = team_specs(env)
    env.close()
    return specs


def decide_precision(node: DictConfig) -> list[Precision]:
    """Replace ``precision=auto`` of all networks by what this machine has: the run stores it.

    Args:
        node: The configuration of a new run; it is changed.

    Returns:
        What was decided, once for each network.

    Raises:
        ConfigError: If the device does not exist.
    """
    decided = []
    for algorithm in (node.algo, *node.learner.values()):
        network = algorithm.get("network")
        if network is not None and network.get("precision") is Precision.auto:
            network.precision = Precision.auto.on(find_device(node.device))
            decided.append(network.precision)
    return decided


def find_device(name: str) -> torch.device:
    """Return the device called `name`.

    Raises:
        ConfigError: If there is none.
    """
    found = [f"cuda:{i}" for i in range(torch.cuda.device_count())]
    choices = ["cpu", *(["cuda"] if found else []), *found]
    if name not in choices:
        raise ConfigError(f"device={name} is not on this machine; choices: {', '.join(choices)}")
    return torch.device(name)


def make_reporters(cfg: Config, folder: RunFolder, resumed_frames: int) -> list[Reporter]:
    """Return the loggers of a run, without rows that will be written again."""
    return [
        make_reporter(kind, folder.path, folder.identifier, resumed_frames)
        for kind in cfg.log.logger
    ]


# Memory of the processes of a run beside replay buffers, an estimate. The sum of their proportional
# set sizes (Pss in proc(5)) was at most 2.0 GB for SAC on KickTheBall with the default network,
# which has four processes beside the learner, and 0.74 GB for `+experiment=smoke algo=sac`, which
# has none.
_LEARNER_BYTES = 750_000_000
_OTHER_BYTES = 350_000_000


def runs_at_once(configs: Mapping[str, Config], cores: int) -> int:
    """Return the number of runs that fit together, whichever of them they are; at least 1.

    One world is built and closed for each game with other teams, senses or bodies.

    Args:
        configs: Name of each run to its configuration.
        cores: Cores of each run.

    Raises:
        ConfigError: If a run does not fit alone, with its name and what to change.
    """
    known: dict[str, dict[str, StorageNeeded]] = {}
    needs = []
    for name, cfg in configs.items():
        key = repr((cfg.game, cfg.algo, cfg.learner, sorted(cfg.frozen)))
        try:
            if key not in known:
                known[key] = storage_of(cfg)
            check_storage(known[key])
        except ValueError as error:
            raise ConfigError(f"{name}: {one_line(error)}") from error
        needs.append({**known[key], "": StorageNeeded(_process_bytes(cfg, cores))})
    return max(1, runs_that_fit(needs))


def storage_of(cfg: Config) -> dict[str, StorageNeeded]:
    """Return what each team of a run stores, from its specifications and numbers.

    Raises:
        ConfigError: If no world can be made.
        ValueError: If an algorithm cannot be made as configured.
    """
    cpu = torch.device("cpu")
    return {
        team: make_algorithm(team, spec, cfg.learner.get(team, cfg.algo), cpu).storage_needed
        for team, spec in read_specs(cfg.game).items()
        if team not in cfg.frozen
    }


def _process_bytes(cfg: Config, cores: int) -> int:
    """Return the memory of the learner, of processes that collect, and of as many that evaluate."""
    return _LEARNER_BYTES + 2 * cfg.collect.processes_on(cores) * _OTHER_BYTES

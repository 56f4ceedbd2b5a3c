"""Train on a task: ``python -m veca_marl.train +task=KickTheBall``.

The Hydra entry: configuration -> environments -> algorithm -> loop.
"""

from __future__ import annotations

import errno
import logging
import os
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, cast

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from veca_marl.algos.checkpoint import CheckpointError, Checkpoints, Identity
from veca_marl.algos.loop import Budget, Trainer
from veca_marl.algos.metrics import CsvReporter, Reporter, TensorBoardReporter
from veca_marl.algos.opponents import load_actor
from veca_marl.algos.ppo import PPO
from veca_marl.algos.self_play import Pool, SelfPlay
from veca_marl.algos.specs import TeamSpec, team_specs
from veca_marl.config import CONF, Config, compose_node, to_config
from veca_marl.config_errors import ConfigError, one_line
from veca_marl.envs.env import VecaEnv
from veca_marl.envs.game_cfg import GameCfg
from veca_marl.recording import record_episode
from veca_marl.run_folder import RunFolder, new_run, open_run, remove_if_empty

_COMMAND = "python -m veca_marl.train"
_DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
RESUMABLE = ("resume", "total_frames", "max_minutes", "device", "threads")


def make_env(game: GameCfg, worlds: int, seed: int) -> VecaEnv:
    """Return `worlds` games in one environment; bound to its game it is an `EnvFactory`."""
    return VecaEnv(game, worlds, seed)


def make_trainer(cfg: Config, folder: RunFolder) -> Trainer:
    """Put together what trains as configured, into `folder`.

    Raises:
        ConfigError: If the device or the world cannot be.
        CheckpointError: If the run to continue does not fit.
    """
    device = find_device(cfg.device)
    if cfg.threads is not None:
        torch.set_num_threads(cfg.threads)
    torch.manual_seed(cfg.seed)
    specs = read_specs(cfg.game)
    checkpoints = Checkpoints(
        folder.checkpoints,
        Identity(cfg.task.name, specs),
        cast(dict[str, Any], OmegaConf.to_container(OmegaConf.structured(cfg), enum_to_str=True)),
        cfg.log.keep_checkpoints,
    )
    trainer = Trainer(
        make_env=partial(make_env, cfg.game),
        algorithm=make_algorithm(cfg, specs, device),
        collect=cfg.collect,
        evaluation=cfg.eval,
        budget=Budget(cfg.total_frames, cfg.max_minutes),
        checkpoints=checkpoints,
        reporters=[],
        seed=cfg.seed,
        progress_bar=cfg.log.progress_bar,
    )
    if cfg.self_play.teams:
        pool = Pool(folder.path / "pool")
        trainer.matchmaking = make_self_play(cfg, trainer.algorithm, pool)
    if cfg.resume is not None:
        trainer.resume(checkpoints.latest())
    return trainer


def make_algorithm(cfg: Config, specs: dict[str, TeamSpec], device: torch.device) -> PPO:
    """Return what learns all teams but those with an opponent from another run.

    Raises:
        ConfigError: If a team does not exist, or nobody learns.
        CheckpointError: If an opponent cannot be loaded.
    """
    frozen = cfg.frozen
    for key, asked in (("opponent", frozen), ("learner", cfg.learner)):
        unknown = sorted(set(asked) - set(specs))
        if unknown:
            raise ConfigError(f"{key}: no teams {unknown} learn here; there are {sorted(specs)}")
    if set(frozen) == set(specs):
        raise ConfigError(f"opponent: nobody learns: all of {sorted(specs)} are opponents")
    actors = {team: load_actor(path, team, specs[team]) for team, path in frozen.items()}
    return PPO(specs, cfg.algo, device, cfg.learner, actors)


def make_self_play(cfg: Config, algorithm: PPO, pool: Pool) -> SelfPlay:
    """Return the matchmaking between a team and past selves of another.

    Raises:
        ConfigError: If a team does not learn.
    """
    try:
        return SelfPlay(cfg.self_play, algorithm, pool, cfg.seed)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def train(cfg: Config, folder: RunFolder, trainer: Trainer) -> list[str]:
    """Train, film, sum up; return how each team compares with random play."""
    trainer.reporters = make_reporters(cfg, folder, trainer.progress.frames)
    lines = trainer.run()
    if cfg.log.video:
        with trainer.watch.measure("video"):
            record_episode(folder.video, cfg.game, trainer.player, cfg.seed)
    for reporter in trainer.reporters:
        reporter.close()
    folder.write("comparison.txt", "\n".join(lines))
    folder.write("timing.txt", trainer.timing())
    print(trainer.timing(), *lines, f"run folder: {folder.path}", sep="\n")  # noqa: T201
    return lines


def read_specs(game: GameCfg) -> dict[str, TeamSpec]:
    """Build one world to see what its teams perceive and do.

    Raises:
        ConfigError: If no world can be made from `game`.
    """
    try:
        env = make_env(game, 1, 0)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    specs = team_specs(env)
    env.close()
    return specs


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
    """Return what writes the numbers down, rid of rows that will be written again."""
    reporters: list[Reporter] = [CsvReporter(folder.path, resumed_frames)]
    if cfg.log.tensorboard:
        reporters.append(TensorBoardReporter(folder.path, resumed_frames))
    return reporters


def stored_config(folder: RunFolder, asked: DictConfig, overrides: list[str]) -> Config:
    """Return the configuration of an earlier run, with the changes a resumption may make.

    Args:
        folder: The earlier run.
        asked: The configuration composed from this command line.
        overrides: What this command line says.

    Raises:
        ConfigError: If anything else is to change, or it is a run of another task.
    """
    stored = OmegaConf.load(folder.config)
    task = stored.task.name
    names = {text.partition("=")[0]: text.partition("=")[2] for text in overrides}
    if names.pop("+task", task) != task:
        raise ConfigError(f"{folder.path} is a run of {task}, not of {asked.task.name}")
    changed = sorted(set(names) - set(RESUMABLE))
    if changed:
        raise ConfigError(
            f"a resumed run stays as it was: cannot change {', '.join(changed)}; "
            f"choices: {', '.join(RESUMABLE)}"
        )
    node = cast(DictConfig, OmegaConf.merge(compose_node([f"+task={task}"]), stored))
    for name in names:
        node[name] = asked[name]
    return to_config(node)


@hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")
def run(node: DictConfig) -> None:
    """Train in the folder that Hydra made."""
    path = Path(HydraConfig.get().runtime.output_dir)
    try:
        cfg, folder, trainer = set_up(node, path)
    except (ConfigError, CheckpointError) as error:
        remove_if_empty(path)
        give_up(error)
    try:
        train(cfg, folder, trainer)
    except KeyboardInterrupt:
        print(f"\ninterrupted; continue with: {_COMMAND} resume={path}", file=sys.stderr)  # noqa: T201
        raise SystemExit(130) from None
    except CheckpointError as error:
        give_up(error)
    except OSError as error:
        if error.errno not in _DISK_FULL:
            raise
        give_up(ConfigError(f"{error}; make room and continue with resume={path}"))


def set_up(node: DictConfig, path: Path) -> tuple[Config, RunFolder, Trainer]:
    """Make ready to start or to continue the run in `path`; claim it last."""
    if node.resume is not None:
        folder = open_run(path)
        cfg = stored_config(folder, node, list(HydraConfig.get().overrides.task))
        return cfg, folder, make_trainer(cfg, folder)
    folder = new_run(path)
    cfg = to_config(node)
    trainer = make_trainer(cfg, folder)
    folder.begin(node)
    return cfg, folder, trainer


def give_up(error: Exception) -> NoReturn:
    """Say in one line what is wrong and end with status 2."""
    print(f"error: {one_line(error)}", file=sys.stderr)  # noqa: T201
    raise SystemExit(2)


def main() -> None:
    """Run the command line; what is wrong with it is said in one line, with exit status 2."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions come here instead of being printed
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # schedulers stop runs by it
    try:
        run()
    except (HydraException, OmegaConfBaseException) as error:
        give_up(error)


if __name__ == "__main__":
    main()

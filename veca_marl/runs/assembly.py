"""From a configuration to what trains: environments, algorithm, matchmaking, checkpoints, logs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, cast

import torch
from omegaconf import OmegaConf

from veca_marl.algos.ppo.ppo import PPO
from veca_marl.algos.selfplay.self_play import Pool, SelfPlay
from veca_marl.algos.specs import TeamSpec, team_specs
from veca_marl.algos.training.checkpoint import Checkpoints, Identity
from veca_marl.algos.training.learnt import load_actor, load_network
from veca_marl.algos.training.loop import Budget, Trainer
from veca_marl.algos.training.metrics import CsvReporter, Reporter, TensorBoardReporter
from veca_marl.config import Config, ConfigError, one_line
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.runs.run_folder import RunFolder


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
        pool = Pool(folder.pool)
        trainer.matchmaking = make_self_play(cfg, trainer.algorithm, pool)
    if cfg.resume is not None:
        trainer.resume(checkpoints.latest())
    return trainer


def make_algorithm(cfg: Config, specs: dict[str, TeamSpec], device: torch.device) -> PPO:
    """Return what learns all teams but those with an opponent from another run.

    Raises:
        CheckpointError: If an opponent, or what a team begins with, cannot be loaded.
    """
    actors = {team: load_actor(path, team, specs[team]) for team, path in cfg.frozen.items()}
    algorithm = PPO(specs, cfg.algo, device, cfg.learner, actors)
    if cfg.resume is None:
        for team, path in cfg.warm_start.items():
            network = cfg.learner.get(team, cfg.algo).network
            algorithm.begin_with(team, load_network(Path(path), team, specs[team], network))
    return algorithm


def make_self_play(cfg: Config, algorithm: PPO, pool: Pool) -> SelfPlay:
    """Return the matchmaking between a team and past selves of another."""
    return SelfPlay(cfg.self_play, algorithm, pool, cfg.seed)


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

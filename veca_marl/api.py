"""The front door for notebooks and scripts: the same choices as on the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from veca_marl.config import compose
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS


def list_tasks() -> list[str]:
    """Return the names that `make` takes."""
    return sorted(TASKS)


def make(
    task: str,
    *,
    worlds: int = 1,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
) -> VecaEnv:
    """Make a task as a TorchRL environment. What is left out is as on the command line.

    Args:
        task: One of `list_tasks`.
        worlds: How many copies of the game, played in one process side by side.
        playground: A file of `conf/playground`, such as `simple`; None is the task's own.
        body: A file of `conf/body`, such as `walker_discrete`.
        senses: Sense to preset, a file of `conf/senses/<sense>`, such as `{"audio": "mono"}`.
        seed: The same seed gives the same worlds, bit by bit; None is fresh entropy.
        overrides: Anything else the command line takes, such as `["task.life_s=4.0"]`.

    Returns:
        An environment with `batch_size=[worlds]`.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(task, playground=playground, body=body, senses=senses, overrides=overrides)
    return VecaEnv(cfg, worlds=worlds, seed=seed)


def choose(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
) -> GameCfg:
    """Return what `make` plays, for the faces of other libraries. The arguments are the same.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
    """
    choices = [f"+task={task}"]
    choices += [] if playground is None else [f"playground={playground}"]
    choices += [] if body is None else [f"body={body}"]
    choices += [f"senses/{sense}={preset}" for sense, preset in (senses or {}).items()]
    return compose([*choices, *overrides]).game

"""Functions for notebooks and scripts that make tasks by name, as the command line does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from veca_marl.config import compose
from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.spaces import SensesLayout
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS
from veca_marl.gymnasium_ids import register_task

TASKS.listen(register_task)


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


def gym_env(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    render_mode: str | None = None,
    layout: str = "arrays",
) -> VecaGymEnv:
    """Make a task of one agent: what `gymnasium.make("veca_marl/<task>-v0", ...)` calls.

    Args:
        task: One of `list_tasks`.
        playground: As for `make`.
        body: As for `make`.
        senses: As for `make`.
        seed: Used until `reset` is given one; None is fresh entropy.
        overrides: As for `make`.
        render_mode: `rgb_array` if `render` is to be called.
        layout: `arrays` gives each sense in its own shape, as TorchRL and PettingZoo get it;
            `stacked` gives both eyes as one image `(6, H, W)` and every other sense as a vector,
            as the CNN of Stable-Baselines3 expects.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If the task is one for several agents, or a number is impossible.
    """
    cfg = choose(task, playground=playground, body=body, senses=senses, overrides=overrides)
    return VecaGymEnv(cfg, seed, render_mode, SensesLayout.named(layout))


def parallel_env(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    render_mode: str | None = None,
) -> VecaParallelEnv:
    """Make a task of any number of agents as a PettingZoo `ParallelEnv`.

    Args:
        task: One of `list_tasks`.
        playground: As for `make`.
        body: As for `make`.
        senses: As for `make`.
        seed: Used until `reset` is given one; None is fresh entropy.
        overrides: As for `make`.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(task, playground=playground, body=body, senses=senses, overrides=overrides)
    return VecaParallelEnv(cfg, seed, render_mode)


def choose(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
) -> GameCfg:
    """Return the configuration of the game that `make` makes. The arguments are the same.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
    """
    choices = [f"+task={task}"]
    choices += [] if playground is None else [f"playground={playground}"]
    choices += [] if body is None else [f"body={body}"]
    choices += [f"senses/{sense}={preset}" for sense, preset in (senses or {}).items()]
    return compose([*choices, *overrides]).game

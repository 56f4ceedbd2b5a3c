"""Functions for notebooks and scripts: the choices of the command line as arguments.

`make`, `gym_env` and `parallel_env` make the environment of a task, `train` trains on it,
`check_task` checks it.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields
from pathlib import Path
from typing import Any

from veca_marl.checks import CheckCfg, TaskReport, check_game
from veca_marl.config import Config, ConfigError, compose, compose_node, to_config
from veca_marl.config.command_line import check_folder
from veca_marl.config.overrides import parse, root_of
from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.spaces import SensesLayout
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg, Script
from veca_marl.envs.core.task import TASKS, Task
from veca_marl.gymnasium_ids import register_task
from veca_marl.plugins import load_plugins
from veca_marl.registry import unknown
from veca_marl.runs.assembly import decide_precision, make_trainer
from veca_marl.runs.continuation import resume_argument
from veca_marl.runs.run_folder import locked, new_run
from veca_marl.runs.training import TrainingResult, run_training

# `opponent` is the configuration of `GameCfg.script`
_ROOTS_OF_GAMES = {f.name for f in fields(GameCfg)} - {"script"} | {"opponent", "plugins"}


def check_name(argument: str, value: Any) -> None:
    """Check an argument that is a name.

    Raises:
        ConfigError: If it is no text.
    """
    if not isinstance(value, str):
        raise ConfigError(f"{argument}={value!r} must be a name, as text")


def check_list(argument: str, value: Any, example: str) -> None:
    """Check an argument that is a list of texts.

    Args:
        argument: Its name.
        value: Its value.
        example: A list that it may be, for the message.

    Raises:
        ConfigError: If it is one text, or another thing than a list of texts.
    """
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if not is_list or not all(isinstance(entry, str) for entry in value):
        raise ConfigError(f"{argument}={value!r} must be a list of texts, such as {example}")


def check_game_overrides(overrides: Sequence[str]) -> None:
    """Check that all overrides change the game, which is all that an environment has.

    Raises:
        ConfigError: If one is of the seed, or of another part of the configuration.
    """
    for override in parse(overrides):
        root = root_of(override)
        if override.key_or_group == "task":
            raise ConfigError(
                f"overrides: {override.input_line!r} chooses another task; give it as the argument "
                "`task`"
            )
        if root == "seed":
            raise ConfigError(
                f"overrides: {override.input_line!r} is not of the game; give the seed as the "
                "argument `seed` (of check_task as checks=CheckCfg(seed=...))"
            )
        if root not in _ROOTS_OF_GAMES:
            raise ConfigError(
                f"overrides: {override.input_line!r} is not of the game; "
                f"choices: {', '.join(sorted(_ROOTS_OF_GAMES))}"
            )


def check_run_overrides(overrides: Sequence[str], total_frames: Any) -> None:
    """Check that no override is of an argument of `train`, or of Hydra.

    Args:
        overrides: The overrides.
        total_frames: The argument; None if it was not given.

    Raises:
        ConfigError: If one is.
    """
    given = {"task": "task", "seed": "seed", "hydra": "folder"}
    if total_frames is not None:
        given["total_frames"] = "total_frames"
    for override in parse(overrides):
        key = override.key_or_group
        argument = given.get("hydra" if key.partition(".")[0] == "hydra" else key)
        if argument is not None:
            raise ConfigError(
                f"overrides: {override.input_line!r} is chosen by the argument `{argument}`"
            )


def check_scripted(cfg: Config) -> None:
    """Check that no opponent is the policy of a run, which no environment plays.

    Raises:
        ConfigError: If one is.
    """
    for team, path in cfg.frozen.items():
        raise ConfigError(
            f"opponent.{team}={path}: an environment does not play the policy of a run; choices: "
            f"{', '.join(script.value for script in Script)}; `train` and "
            "python -m veca_marl.evaluate play it"
        )


def check_presets(argument: str, value: Any) -> None:
    """Check an argument that gives names of senses the names of presets.

    Raises:
        ConfigError: If it does not.
    """
    is_mapping = isinstance(value, Mapping)
    if not is_mapping or not all(isinstance(part, str) for pair in value.items() for part in pair):
        raise ConfigError(f'{argument}={value!r} must be a mapping, such as {{"audio": "mono"}}')


def as_integer(argument: str, value: Any) -> int:
    """Return an argument that is an integral number, such as 1e6.

    Raises:
        ConfigError: If it is none.
    """
    try:
        return operator.index(value)  # exact, also where a float has fewer digits
    except TypeError:
        pass
    try:
        number = float(value)
        if number.is_integer() and not isinstance(value, str):
            return int(number)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ConfigError(f"{argument}={value!r} must be an integral number")


TASKS.listen(register_task)


def list_tasks(plugins: Sequence[str] = (), suite: str = "veca") -> list[str]:
    """Return the names that `make` takes of one suite, with the tasks of plug-ins.

    Args:
        plugins: Packages beside the installed plug-ins, see `veca_marl.plugins`.
        suite: `veca` for the 24 tasks of the paper and those of plug-ins that name no other suite,
            `babybench` for SelfTouch and HandRegard, or a suite that a plug-in names.

    Raises:
        PluginError: If a plug-in cannot be loaded.
        ConfigError: If `plugins` is no list of names, or `suite` no name.
        ValueError: If there is no such suite; the message lists those there are.
    """
    check_list("plugins", plugins, '["my_tasks"] (a suite is suite="babybench")')
    check_name("suite", suite)
    load_plugins(plugins)
    suites = {task.suite for task in TASKS.values()}
    if suite not in suites:
        raise ValueError(unknown("suite", suite, sorted(suites)))
    return sorted(name for name, task in TASKS.items() if task.suite == suite)


def make(
    task: str,
    *,
    worlds: int = 1,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
) -> VecaEnv:
    """Make a task as a TorchRL environment. What is left out is as on the command line.

    Args:
        task: One of `list_tasks`.
        worlds: How many copies of the game, played in one process side by side.
        playground: A file of `conf/playground`, such as `simple`; None is the task's own.
        body: A file of `conf/body`, such as `walker_discrete`.
        senses: Sense to preset, a file of `conf/senses/<sense>`, such as `{"audio": "mono"}`.
        seed: The same seed gives the same worlds, bit by bit; None is fresh entropy.
        overrides: Anything else of the game that the command line takes, such as
            `["task.life_s=4.0"]`.
        plugins: Packages that add tasks or presets and are not installed as plug-ins.

    Returns:
        An environment with `batch_size=[worlds]`.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(
        task, playground=playground, body=body, senses=senses, overrides=overrides, plugins=plugins
    )
    return VecaEnv(cfg, worlds=worlds, seed=seed)


def gym_env(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
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
        plugins: As for `make`.
        render_mode: `rgb_array` if `render` is to be called.
        layout: `arrays` gives each sense in its own shape, as TorchRL and PettingZoo get it;
            `stacked` gives both eyes as one image `(6, H, W)` and every other sense as a vector,
            as the CNN of Stable-Baselines3 expects.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If the task is one for several agents, or a number is impossible.
    """
    cfg = choose(
        task, playground=playground, body=body, senses=senses, overrides=overrides, plugins=plugins
    )
    return VecaGymEnv(cfg, seed, render_mode, SensesLayout.named(layout))


def parallel_env(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
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
        plugins: As for `make`.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(
        task, playground=playground, body=body, senses=senses, overrides=overrides, plugins=plugins
    )
    return VecaParallelEnv(cfg, seed, render_mode)


def train(
    task: str,
    *,
    total_frames: float | None = None,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
) -> TrainingResult:
    """Train on a task, as ``python -m veca_marl.train`` does.

    Args:
        task: One of `list_tasks`.
        total_frames: Frames of experience; None is the default of the command line.
        playground: As for `make`.
        body: As for `make`.
        senses: As for `make`.
        seed: Seed of the run.
        folder: Folder of the run, as the command writes it; None stores nothing.
        overrides: Anything else the command line takes, such as `["algo=mappo"]`.
        plugins: As for `make`.

    Returns:
        The rows of the metrics and of the evaluations, and the policy.

    Raises:
        ConfigError: If there is no such choice, there is a run in `folder` or another process
            trains in it, or a run is to be resumed.
        CheckpointError: If something cannot be loaded or stored.
    """
    path = None if folder is None else check_folder(folder, "folder")
    with nullcontext() if path is None else locked(path):
        run = None if path is None else new_run(path)
        chosen = _choices(task, playground, body, senses, plugins)
        if total_frames is not None:
            chosen.append(f"total_frames={as_integer('total_frames', total_frames)}")
        check_list("overrides", overrides, '["algo=mappo"]')
        check_run_overrides(overrides, total_frames)
        chosen += [f"seed={as_integer('seed', seed)}", *overrides]
        node = compose_node(chosen)
        if node.resume is not None:
            raise ConfigError(
                f"resume={node.resume}: `train` begins a new run; continue one with "
                f"python -m veca_marl.train {resume_argument(node.resume)}"
            )
        decide_precision(node)
        cfg = to_config(node)
        trainer = make_trainer(cfg, run)
        if run is not None:
            run.begin(node, chosen)
        return run_training(cfg, run, trainer)


def check_task(
    task: type[Task] | str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
    checks: CheckCfg | None = None,
) -> TaskReport:
    """Check a task, for people who write one; ``print(check_task(MyTask))`` shows the results.

    The checks: it builds; TorchRL accepts its specs; the same seed gives the same bytes in new and
    used worlds, another seed others; starts are inside the rooms, differ, are not over, and not
    some of them are solved; observations fit their specs and change; rewards are finite and each
    term is reached; the expert, if there is one, has a higher return than the random policy and
    solves more episodes; the time of a step.

    Args:
        task: A registered class, or its name.
        playground: As for `make`.
        body: As for `make`.
        senses: As for `make`.
        overrides: As for `make`.
        plugins: As for `make`.
        checks: How much is played; None is `CheckCfg()`.

    Returns:
        A result for each check. An exception of the task is a failed result with its type, message
        and place.

    Raises:
        ConfigError: If there is no such choice, or the configuration is impossible.
        ValueError: If the class is not registered.
    """
    if not isinstance(task, (str, type)):
        raise ConfigError(f"task={task!r} must be a registered class or its name")
    name = task if isinstance(task, str) else task.__name__
    if not isinstance(task, str) and TASKS.get(name) is not task:
        raise ValueError(f"task {name!r} is not registered; decorate the class with @register_task")
    cfg = choose(
        name, playground=playground, body=body, senses=senses, overrides=overrides, plugins=plugins
    )
    if checks is not None and not isinstance(checks, CheckCfg):
        raise ConfigError(f"checks={checks!r} must be a CheckCfg, or None")
    return check_game(cfg, checks or CheckCfg())


def choose(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[str] = (),
) -> GameCfg:
    """Return the configuration of the game that `make` makes. The arguments are the same.

    Raises:
        ConfigError: If there is no such choice, or an override is not of the game; the message
            lists the choices there are.
    """
    check_list("overrides", overrides, '["task.life_s=4.0"]')
    check_game_overrides(overrides)
    cfg = compose([*_choices(task, playground, body, senses, plugins), *overrides])
    check_scripted(cfg)
    return cfg.game


def _choices(
    task: str,
    playground: str | None,
    body: str | None,
    senses: Mapping[str, str] | None,
    plugins: Sequence[str],
) -> list[str]:
    """Return the arguments as overrides."""
    check_list("plugins", plugins, '["my_tasks"]')
    check_presets("senses", senses or {})
    for argument, value in (("task", task), ("playground", playground), ("body", body)):
        if argument == "task" or value is not None:
            check_name(argument, value)
    choices = [f"+task={task}"]
    choices += [f"plugins=[{','.join(plugins)}]"] if plugins else []
    choices += [] if playground is None else [f"playground={playground}"]
    choices += [] if body is None else [f"body={body}"]
    return choices + [f"senses/{sense}={preset}" for sense, preset in (senses or {}).items()]

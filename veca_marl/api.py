"""Functions for notebooks and scripts: the choices of the command line as arguments.

`make`, `gym_env` and `parallel_env` make the environment of a task, `connect` that of a server's,
`train` trains on it, `save_episode` plays it into a page for browsers, `check_task` checks it.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, Unpack

import torch
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.algos.evaluation.evaluate import ActionPolicy
from veca_marl.checks import CheckCfg, TaskReport, check_game
from veca_marl.config import ConfigError, compose_node, to_config
from veca_marl.config.choices import (
    GameChoices,
    check_list,
    check_names,
    check_overrides,
    choose,
    chosen_overrides,
)
from veca_marl.config.command_line import check_file, check_folder
from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.spaces import SpaceLayout
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.task import TASKS, Task
from veca_marl.gymnasium_ids import register_task
from veca_marl.plugins import Plugin, load_plugins
from veca_marl.registry import unknown
from veca_marl.runs.assembly import decide_precision, find_device, make_trainer
from veca_marl.runs.continuation import resume_argument
from veca_marl.runs.episode_page import EpisodeRecorder, play, write_page
from veca_marl.runs.lock import locked
from veca_marl.runs.run_folder import new_run
from veca_marl.runs.served_worlds import import_remote
from veca_marl.runs.training import TrainingResult, run_training
from veca_marl.runs.video import SAMPLE_RATE_HZ

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def _with_choices(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let `help` and the completion of notebooks show `GameChoices` as arguments."""
    own = signature(function, eval_str=True)
    named = [one for one in own.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
    _, *common = signature(chosen_overrides, eval_str=True).parameters.values()
    function.__signature__ = own.replace(parameters=named + common)  # type: ignore[attr-defined]
    return function


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
        ConfigError: If `plugins` is no list of names.
        ValueError: If there is no such suite; the message lists those there are.
    """
    check_list("plugins", plugins, '["my_tasks"] (a suite is suite="babybench")')
    load_plugins(plugins)
    suites = {task.suite for task in TASKS.values()}
    if not isinstance(suite, str) or suite not in suites:
        raise ValueError(unknown("suite", str(suite), sorted(suites)))
    return sorted(name for name, task in TASKS.items() if task.suite == suite)


@_with_choices
def make(
    task: str,
    *,
    worlds: int = 1,
    seed: int | None = None,
    device: torch.device | str | None = None,
    **choices: Unpack[GameChoices],
) -> VecaEnv:
    """Make a task as a TorchRL environment. What is left out is as on the command line.

    Args:
        task: One of `list_tasks`.
        worlds: How many copies of the game, played in one process side by side.
        seed: The same seed gives the same worlds, bit by bit; None is fresh entropy.
        device: Where the tensors are; the worlds are simulated on the CPU. None is the CPU, with
            TensorDicts that name no device.
        **choices: ``playground``, a file of `conf/playground`, such as `simple` (None is the
            task's own); ``body``, a file of `conf/body`, such as `walker_discrete`; ``senses``,
            sense to preset, a file of `conf/senses/<sense>`, such as `{"audio": "mono"}`;
            ``development``, an age in months, from 1 to 36, of bodies and senses;
            ``overrides``, anything else of the game that the command line takes, such as
            `["task.life_s=4.0"]`; ``plugins``, packages that add tasks or presets and are not
            installed as plug-ins.

    Returns:
        An environment with `batch_size=[worlds]`.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(task, **choices)
    placed = None if device is None else find_device(str(device))
    env = VecaEnv(cfg, worlds=worlds, seed=seed)
    return env if placed is None else env.to(placed)


@_with_choices
def gym_env(
    task: str,
    *,
    seed: int | None = None,
    render_mode: str | None = None,
    layout: str = "arrays",
    **choices: Unpack[GameChoices],
) -> VecaGymEnv:
    """Make a task of one agent: what `gymnasium.make("veca_marl/<task>-v0", ...)` calls.

    Args:
        task: One of `list_tasks`.
        seed: Used until `reset` is given one; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called; `human` shows each reset and step in a
            window (extra ``[play]``).
        layout: `arrays` gives each sense in its own shape, as TorchRL and PettingZoo get it;
            `stacked` gives both eyes as one image `(6, H, W)` and every other sense as a vector,
            as the CNN of Stable-Baselines3 expects; `flat` gives one vector of all senses. In both
            an action of several parts is one array, see `SpaceLayout`.
        **choices: As for `make`.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If the task is one for several agents, or a number is impossible.
    """
    cfg = choose(task, **choices)
    return VecaGymEnv(cfg, seed, render_mode, SpaceLayout.named(layout))


@_with_choices
def parallel_env(
    task: str,
    *,
    seed: int | None = None,
    render_mode: str | None = None,
    layout: str = "arrays",
    **choices: Unpack[GameChoices],
) -> VecaParallelEnv:
    """Make a task of any number of agents as a PettingZoo `ParallelEnv`.

    Args:
        task: One of `list_tasks`.
        seed: Used until `reset` is given one; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called; `human` shows each reset and step in a
            window (extra ``[play]``).
        layout: As for `gym_env`.
        **choices: As for `make`.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If a number is impossible.
    """
    cfg = choose(task, **choices)
    return VecaParallelEnv(cfg, seed, render_mode, SpaceLayout.named(layout))


def connect(
    address: str,
    *,
    key: str | Path | None = None,
    library: str = "torchrl",
    worlds: int | None = None,
    seed: int | None = None,
    device: torch.device | str | None = None,
    render_mode: str | None = None,
    layout: str = "arrays",
    timeout_s: float = 60.0,
) -> VecaEnv | VecaGymEnv | VecaParallelEnv:
    """Make an environment of the game that ``python -m veca_marl.serve`` serves at an address.

    It has worlds of its own there, and returns the same bytes as an environment of this process
    with the same configuration and seed. Closing it ends them.

    Args:
        address: Address of the server, such as ``tcp://host:5555``.
        key: File of keys that the owner of the server has made for this client; None for a server
            without keys.
        library: ``torchrl`` for what `make` returns, ``gymnasium`` for `gym_env`, ``pettingzoo``
            for `parallel_env`.
        worlds: Worlds of a TorchRL environment; None is as many as the server gives. The others
            have one.
        seed: As for `make`.
        device: As for `make`; TorchRL only.
        render_mode: As for `gym_env`; not for TorchRL.
        layout: As for `gym_env`; not for TorchRL.
        timeout_s: Seconds without a word of the server after which it is given up. A server that
            works says so each second, however long it takes.

    Raises:
        ConfigError: If there is no such library, or an argument is not of it.
        ValueError: If an argument is impossible, the server gives fewer worlds, or the task is one
            for several agents and the library Gymnasium.
        KeyFileError: If the file of keys cannot be used.
        RemoteError: If there is no server, it refuses this client, or later, it has lost its
            worlds.
        ModuleNotFoundError: Without the extra ``[remote]``.
    """
    choices = {"torchrl": ("worlds", "device"), "gymnasium": _SPACES, "pettingzoo": _SPACES}
    if library not in choices:
        raise ConfigError(unknown("library", str(library), list(choices)))
    given = {"worlds": worlds, "device": device, "render_mode": render_mode}
    given["layout"] = None if layout == "arrays" else layout
    for name, value in given.items():
        if value is not None and name not in choices[library]:
            raise ConfigError(f"{name}={value!r} is no argument of library={library!r}")
    placed = None if device is None else find_device(str(device))
    remote, games = import_remote("client"), import_remote("games")
    there = remote.RemoteWorlds(address, key, timeout_s)
    host = games.RemoteHost(there)
    if library == "torchrl":
        env = VecaEnv(there.cfg, there.most if worlds is None else worlds, seed, host=host)
        return env if placed is None else env.to(placed)
    adapter = VecaGymEnv if library == "gymnasium" else VecaParallelEnv
    return adapter(there.cfg, seed, render_mode, SpaceLayout.named(layout), host)


_SPACES = ("render_mode", "layout")


@_with_choices
def train(
    task: str,
    *,
    total_frames: float | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    **choices: Unpack[GameChoices],
) -> TrainingResult:
    """Train on a task, as ``python -m veca_marl.train`` does.

    Args:
        task: One of `list_tasks`.
        total_frames: Frames of experience; None is the default of the command line.
        seed: Seed of the run.
        folder: Folder of the run, as the command writes it; None stores nothing.
        **choices: As for `make`; the overrides may change anything that the command line
            takes, such as `["algo=mappo"]`.

    Returns:
        The rows of the metrics and of the evaluations, and the policy.

    Raises:
        ConfigError: If there is no such choice, there is a run in `folder` or another process
            trains in it, or a run is to be resumed.
        CheckpointError: If something cannot be loaded or stored.
    """
    check_names(choices)
    path = None if folder is None else check_folder(folder, "folder")
    with nullcontext() if path is None else locked(path):
        run = None if path is None else new_run(path)
        arguments = {"task": "task", "seed": "seed", "hydra": "folder"}
        chosen = [*chosen_overrides(task, **choices), f"seed={as_integer('seed', seed)}"]
        if total_frames is not None:
            chosen.append(f"total_frames={as_integer('total_frames', total_frames)}")
            arguments["total_frames"] = "total_frames"
        check_overrides(choices.get("overrides", ()), arguments)
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


@_with_choices
def save_episode(
    path: str | Path,
    task: str,
    *,
    policy: ActionPolicy | None = None,
    seed: int = 1,
    longest_s: float | None = None,
    **choices: Unpack[GameChoices],
) -> Path:
    """Play one episode and store it as a page that any browser opens from disk.

    The page shows the world in 3D and, for each agent on one time line, what it sees, hears, feels,
    does and is rewarded for. It needs neither a server nor a network.

    Args:
        path: The HTML file; missing folders are created.
        task: One of `list_tasks`.
        policy: Writes the actions of all teams into the TensorDict of an environment, such as the
            `policy` that `train` returns, which plays by its most likely actions; None is the
            expert of the task.
        seed: Seed of the episode.
        longest_s: Seconds after which the recording ends; None is the whole episode.
        **choices: As for `make`.

    Returns:
        The file.

    Raises:
        ConfigError: If there is no such choice, or no file can be written there.
        ValueError: If a number is impossible, or the task has no expert.
        WriteError: If the file cannot be written.
    """
    file = check_file(path, "path")
    if file.suffix != ".html":
        raise ConfigError(f"path={path}: must end in .html")
    if longest_s is not None and not 0.0 < longest_s < math.inf:
        raise ConfigError(f"longest_s={longest_s} must be a positive number of seconds, or None")
    cfg = choose(task, **choices).with_waveform()
    with (
        closing(VecaEnv(cfg, 1, as_integer("seed", seed))) as env,
        torch.no_grad(),
        set_exploration_type(ExplorationType.DETERMINISTIC),
    ):
        recorder = EpisodeRecorder(env, longest_s)
        recorder.record(play(env, ExpertPolicy(env) if policy is None else policy))
        details = {"policy": "expert" if policy is None else "given", "seed": seed}
        write_page(file, recorder.episode(cfg.task.name, details, SAMPLE_RATE_HZ))
    return file


@_with_choices
def check_task(
    task: type[Task] | str,
    *,
    checks: CheckCfg | None = None,
    **choices: Unpack[GameChoices],
) -> TaskReport:
    """Check a task, for people who write one; ``print(check_task(MyTask))`` shows the results.

    The checks: it builds; TorchRL accepts its specs; the same seed gives the same bytes in new and
    used worlds, another seed others; starts are inside the rooms, differ, are not over, and not
    some of them are solved; observations fit their specs and change; rewards are finite and each
    term is reached; the expert, if there is one, has a higher return than the random policy and
    solves more episodes; the time of a step.

    Args:
        task: A registered class, or its name. The package of a class is loaded as a plug-in if it
            has configuration files, so that the preset of the task counts.
        checks: How much is played; None is `CheckCfg()`.
        **choices: As for `make`.

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
    cfg = choose(name, **_with_own_plugin(task, choices))
    if checks is not None and not isinstance(checks, CheckCfg):
        raise ConfigError(f"checks={checks!r} must be a CheckCfg, or None")
    return check_game(cfg, checks or CheckCfg())


def _with_own_plugin(task: type[Task] | str, choices: GameChoices) -> GameChoices:
    """Return the choices with the package of a class among the plug-ins, if it has presets."""
    package = "" if isinstance(task, str) else task.__module__.partition(".")[0]
    if package == "veca_marl" or package not in sys.modules or Plugin(package).conf is None:
        return choices
    return {**choices, "plugins": [*choices.get("plugins", ()), package]}

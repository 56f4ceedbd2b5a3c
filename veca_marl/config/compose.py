"""Composition: from overrides, as on the command line, to the typed configuration.

`compose` gives notebooks what the command line gives `train`: the same defaults, the same errors.
"""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, cast, get_args, get_origin, get_type_hints

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from veca_marl.config.errors import ConfigError, one_line
from veca_marl.config.experiment import check_arm
from veca_marl.config.overrides import (
    check_configuration_files,
    check_group_values,
    plugins_in,
    register_search_path,
    state_of_sources,
)
from veca_marl.config.root import Config, register_schemas, store_tasks_without_file
from veca_marl.envs.core.task import TASKS, find_task
from veca_marl.override_text import normalised, short_name
from veca_marl.plugins import PluginError, conf_dir, load_plugins

_MAY_BE_NULL = ("playground.walls",)
"""Groups of values of which some presets have none."""


def check_lengths(node: DictConfig) -> None:
    """Check every field that is declared as a tuple of so many numbers.

    Args:
        node: A configuration, whose nodes know their dataclasses.

    Raises:
        ConfigError: If a value has another length; the message names its key.
    """
    for key, length, value in _tuples(node):
        if len(value) != length:
            given = list(value)
            raise ConfigError(f"{key}={given}: {length} values are needed, got {len(given)}")


def _tuples(node: DictConfig, path: str = "") -> Iterator[tuple[str, int, ListConfig]]:
    """Yield key, declared length and value of all fields that are tuples of a fixed length.

    Args:
        node: A node of the configuration.
        path: What precedes its keys.
    """
    lengths = _declared_lengths(OmegaConf.get_type(node))
    for name in map(str, node):
        if OmegaConf.is_missing(node, name) or OmegaConf.is_interpolation(node, name):
            continue
        value = node[name]
        if isinstance(value, DictConfig):
            yield from _tuples(value, f"{path}{name}.")
        elif isinstance(value, ListConfig) and name in lengths:
            yield f"{path}{name}", lengths[name], value


def _declared_lengths(owner: Any) -> dict[str, int]:
    if not is_dataclass(owner):
        return {}
    hints = {name: get_args(hint) for name, hint in get_type_hints(owner).items() if _fixed(hint)}
    return {name: len(parts) for name, parts in hints.items()}


def _fixed(hint: Any) -> bool:
    return get_origin(hint) is tuple and Ellipsis not in get_args(hint)


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
    """Return what `compose` returns as a typed node; its values can be changed by name.

    Raises:
        ConfigError: One line that names the wrong part and the choices.
    """
    prepared = prepare(overrides)
    node = _composed(prepared)
    check_arm(node.experiment, prepared)
    return node


def compose_other(root: str, overrides: Sequence[str], loaded: Callable[[], None]) -> Any:
    """Return the typed configuration of a command whose root is not that of a run.

    Args:
        root: Its file in `conf/`, without the ending.
        overrides: As on the command line.
        loaded: Stores its schemas; called when the plug-ins are loaded.

    Raises:
        ConfigError: One line that names the wrong part and the choices.
    """
    load_config_plugins([])
    loaded()
    check_group_values(overrides)
    node = _composed(normalised(overrides), root)
    check_lengths(node)
    try:
        return OmegaConf.to_object(node)
    except (OmegaConfBaseException, ValueError) as error:
        raise ConfigError(one_line(error)) from error


def _composed(overrides: Sequence[str], root: str = "config") -> DictConfig:
    """Return what Hydra composes; its errors are one line."""
    try:
        if any(text.lstrip("+~").startswith("hydra") for text in overrides):
            return _by_hydra(root, tuple(overrides))  # it may name further sources
        return _copies_of(root, tuple(overrides), state_of_sources())()
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise ConfigError(one_line(error)) from error


@lru_cache(maxsize=64)
def _copies_of(root: str, overrides: tuple[str, ...], state: Hashable) -> Callable[[], DictConfig]:
    """Return a function that makes what Hydra composes of these words while `state` is equal.

    A composition takes longer than the world that is built from it. Pickled it is read in a fifth
    of the time of a deep copy and needs a twelfth of the memory.
    """
    node = _by_hydra(root, overrides)
    try:
        stored = pickle.dumps(node)
    except (pickle.PicklingError, AttributeError):  # a class that is defined in a function
        return partial(copy.deepcopy, node)
    return partial(pickle.loads, stored)


def _by_hydra(root: str, overrides: tuple[str, ...]) -> DictConfig:
    _check_below_null(overrides)
    with _own_hydra():
        node: DictConfig = hydra.compose(root, overrides=list(overrides))
    return node


def _check_below_null(overrides: Sequence[str]) -> None:
    """Refuse a value below a group that an earlier word sets to null: OmegaConf asserts there.

    Raises:
        ConfigError: One line that names both.
    """
    nulls: set[str] = set()
    for text in overrides:
        key, _, value = text.lstrip("+~").partition("=")
        above = next((one for one in nulls if key.startswith(f"{one}.")), None)
        if above is not None:
            raise ConfigError(f"{key}: {above}=null leaves no values there")
        if value.strip().lower() == "null":
            nulls.add(key.strip())
        else:
            nulls.discard(key.strip())


def prepare(overrides: Sequence[str]) -> list[str]:
    """Load the plug-ins, the installed ones and those named in `overrides`, before composition.

    Returns:
        The overrides, see `normalised`.

    Raises:
        ConfigError: If a plug-in cannot be loaded, or a group has another value than a name.
    """
    _check_readable(overrides)
    load_config_plugins(plugins_in(overrides))
    check_group_values(overrides)
    prepared = normalised(overrides)
    for group in _MAY_BE_NULL:
        _check_parts(group, prepared)
    return prepared


_LONGEST_NUMBER = 4300  # digits; Python reads no longer ones


def _check_readable(overrides: Sequence[str]) -> None:
    """Refuse what makes Python fail before Hydra's grammar could refuse it."""
    for text in overrides:
        if "\0" in text:
            raise ConfigError(f"{text!r}: a null character")
        if not text.strip().lstrip("+~").partition("=")[0].strip():
            raise ConfigError(f"{text!r} has no key: KEY=VALUE is expected")
        if re.search(rf"\d{{{_LONGEST_NUMBER + 1}}}", text):
            raise ConfigError(
                f"{text.partition('=')[0]}: a number of more than {_LONGEST_NUMBER} digits"
            )


def _check_parts(group: str, overrides: Sequence[str]) -> None:
    """Refuse overrides of parts of a group that is null: Hydra fails in them with an assertion."""
    if parts := _parts_of(group, overrides):
        others = _composed([text for text in overrides if text not in parts])
        _refuse_parts(others, group, parts)


def check_parts(node: DictConfig, overrides: Sequence[str]) -> None:
    """Refuse overrides of parts of what is null in a node, as `prepare` does before composition.

    Raises:
        ConfigError: If there is one.
    """
    for group in _MAY_BE_NULL:
        _refuse_parts(node, group, _parts_of(group, overrides))


def _parts_of(group: str, overrides: Sequence[str]) -> list[str]:
    return [text for text in overrides if re.match(rf"[+]*{group}([.]|=[{{])", text)]


def _refuse_parts(node: DictConfig, group: str, parts: Sequence[str]) -> None:
    if parts and OmegaConf.select(node, group) is None:
        raise ConfigError(
            f"{parts[0]}: {group} is null here, so that no part of it can be set; choose another "
            f"preset, such as {group.partition('.')[0]}=house, or write one with {group}"
        )


def load_config_plugins(names: Sequence[str]) -> None:
    """Load plug-ins together with their configuration files.

    Args:
        names: Packages beside the installed plug-ins.

    Raises:
        ConfigError: If one cannot be loaded.
    """
    try:
        load_plugins(names)
        check_configuration_files()
        store_tasks_without_file()
    except PluginError as error:
        raise ConfigError(str(error)) from error


def to_config(node: DictConfig) -> Config:
    """Turn Hydra's node into dataclasses, which check their values.

    Raises:
        ConfigError: If no task is chosen, or a value is impossible.
    """
    if OmegaConf.is_missing(node, "task"):
        raise ConfigError(no_task())
    load_config_plugins(node.plugins)
    check_lengths(node)
    try:
        config = cast(Config, OmegaConf.to_object(node))
        _check_task(config)
        _refuse_extra(config, "")
        config.check_teams()
        config.game.check_bodies()
        config.game.check_playground()
        config.game.check_clock()
    except (OmegaConfBaseException, ValueError) as error:
        raise ConfigError(one_line(error)) from error
    return config


def _check_task(config: Config) -> None:
    """Raise `ValueError` if there is no such task, or the parameters are those of another one."""
    name, found = config.task.name, type(config.task)
    expected = find_task(name).cfg_type()
    if not isinstance(config.task, expected):
        raise ValueError(
            f"task.name={name} takes {expected.__name__}, got {found.__name__}; another task is "
            f"chosen by +task={name}"
        )


def _refuse_extra(config: Any, path: str) -> None:
    """Raise `ValueError` for what ``+key=value`` added to a dataclass."""
    names = [f.name for f in fields(config)]
    for extra in sorted(set(vars(config)) - set(names)):
        raise ValueError(f"unknown key '{path}{extra}'; choices: {', '.join(sorted(names))}")
    for name in names:
        value = getattr(config, name)
        _refuse_extra_inside(value, f"{path}{name}")


def _refuse_extra_inside(value: Any, path: str) -> None:
    if is_dataclass(value):
        _refuse_extra(value, f"{path}.")
    elif isinstance(value, dict):
        for key, entry in value.items():
            _refuse_extra_inside(entry, f"{path}.{key}")


def no_task() -> str:
    """Return the error message for a missing task, with the choices."""
    return f"no task: add +task=NAME; choices: {', '.join(sorted(TASKS))}"


@contextmanager
def _own_hydra() -> Iterator[None]:
    """Compose without a change to the Hydra application that may be running."""
    holder = GlobalHydra.instance()
    running = holder.hydra
    holder.clear()
    try:
        with hydra.initialize_config_dir(str(conf_dir()), version_base="1.3"):
            yield
    finally:
        GlobalHydra.instance().hydra = running


def _run_folder(resume: str | None, task: str | None, now: str) -> str:
    """Return the folder of a run, which Hydra creates."""
    if resume is not None:
        if Path(resume).is_file():
            raise ConfigError(f"resume={resume} is a file; give the folder of a run")
        return resume
    if task is None:
        raise ConfigError(no_task())
    return f"runs/{task}/{now}"


def _sweep_folder(experiment: str | None) -> str:
    """Return the folder of the runs of an experiment, or of other sweeps."""
    return "runs/sweeps" if experiment is None else f"runs/{experiment}"


def _job_folder(arm: str | None, overrides: str, seed: int) -> str:
    """Return the folder of a run within that of its sweep.

    Args:
        arm: Arm of an experiment; None for a sweep without one.
        overrides: The overrides that tell the runs of a sweep apart.
        seed: Seed of the run.
    """
    name = arm or overrides.replace("/", ".").replace("+", "") or "default"
    return f"{short_name(name)}/seed_{seed}"


register_schemas()
register_search_path()
OmegaConf.register_new_resolver("run_folder", _run_folder, replace=True)
OmegaConf.register_new_resolver("sweep_folder", _sweep_folder, replace=True)
OmegaConf.register_new_resolver("job_folder", _job_folder, replace=True)

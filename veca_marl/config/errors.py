"""Errors of the configuration as one line that lists the choices."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from hydra.errors import ConfigCompositionException, MissingConfigException
from omegaconf import DictConfig
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException

_NO_GROUP = re.compile("Invalid type assigned: .* is not a subclass of")
_NO_TEAMS = re.compile(r"Cannot assign \w+ to Dict\[str, (str|Dict.*)\]")
_NO_LIST = re.compile("is not a ListConfig, list or tuple")


class ConfigError(ValueError):
    """An impossible configuration; the message is one line, whatever it quotes.

    Args:
        message: What is wrong, and the choices.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines()))


def one_line(error: BaseException) -> str:
    """Return what is wrong and what the choices are, without a line break."""
    if isinstance(error, ConfigError):
        return _flat(str(error))
    chain = list(_chain(error))
    for cause in chain:
        if isinstance(cause, MissingConfigException) and cause.missing_cfg_file:
            return _unknown_preset(cause)
    for cause in chain:
        if isinstance(cause, OmegaConfBaseException):
            return _wrong_value(cause)
    if isinstance(error, ConfigCompositionException):
        return _wrong_override(str(error))
    return _flat(str(error))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__


def _unknown_preset(error: MissingConfigException) -> str:
    group, _, name = str(error.missing_cfg_file).rpartition("/")
    options = sorted(error.options or ())
    return f"unknown {group} {name!r}{_nearest(name, options)}; choices: {', '.join(options)}"


def _wrong_value(error: OmegaConfBaseException) -> str:
    names = _keys(error)
    if isinstance(error, (ConfigKeyError, AttributeError)) and names:
        key = str(error.full_key or error.key)
        group, _, last = key.rpartition("/")
        names = _names_of_group(error.object_type, group) or names
        near = _nearest(last.rpartition(".")[2], names)
        return f"unknown key {key!r}{near}; choices: {', '.join(names)}"
    message = _flat(str(error).partition("\n")[0])
    if _NO_GROUP.search(message) and error.full_key:
        path, _, group = str(error.full_key).rpartition(".")
        preset = f": choose a preset with {path}/{group}=NAME" if path else ""
        return f"{error.full_key} is a group of values, not a single one{preset}"
    if _NO_LIST.search(message) and error.full_key:
        return f"{error.full_key} must be a list, such as {error.full_key}=[...]"
    if _NO_TEAMS.search(message) and error.full_key:
        key = error.full_key
        return f"{key} needs a team: {key}.TEAM=VALUE; in a game of one team {key}.agents=VALUE"
    _, resolver, said = message.partition(" raised while resolving interpolation: ")
    if resolver:
        return said
    return f"{error.full_key}: {message}" if error.full_key else message


def _keys(error: OmegaConfBaseException) -> list[str]:
    """Return the keys of the node that an error is about."""
    owner: Any = error.object_type
    if is_dataclass(owner):
        return sorted(f.name for f in fields(owner))
    parent = error.parent_node
    return sorted(map(str, parent.keys())) if isinstance(parent, DictConfig) else []


def _names_of_group(root: Any, group: str) -> list[str]:
    """Return the keys of a group, such as ``senses/audio``; none if there is no such group."""
    for part in filter(None, group.split("/")):
        root = get_type_hints(root).get(part) if is_dataclass(root) else None
    return sorted(f.name for f in fields(root)) if group and is_dataclass(root) else []


def _wrong_override(message: str) -> str:
    hint = re.search(r"use \+?\+?(\S+=\S+)", message)
    group = re.search(r"Could not override '([^'@]+)'", message)
    if hint and group:
        return f"{group.group(1)} has no default to replace: write +{hint.group(1).lstrip('+')}"
    return _flat(message)


def _nearest(name: str, choices: list[str]) -> str:
    near = difflib.get_close_matches(name, choices, n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def _flat(message: str) -> str:
    return " ".join(message.split())

"""Lengths of the tuples in a configuration, which OmegaConf does not check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from omegaconf import DictConfig, ListConfig, OmegaConf

from veca_marl.config.errors import ConfigError


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

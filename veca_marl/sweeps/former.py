"""Values that fields had in runs that were stored before the fields existed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from omegaconf import DictConfig, OmegaConf


def former_values(node: DictConfig) -> dict[str, Any]:
    """Return the former values of all fields in a configuration, by dotted path.

    The types of its nodes state them in the class attribute `formerly`, see `NetworkCfg`.
    """
    return dict(_former_values(node, ""))


def _former_values(node: DictConfig, path: str) -> Iterator[tuple[str, Any]]:
    for name, value in getattr(OmegaConf.get_type(node), "formerly", {}).items():
        yield f"{path}{name}", value
    for key in map(str, node):
        has_value = not (OmegaConf.is_missing(node, key) or OmegaConf.is_interpolation(node, key))
        child = node[key] if has_value else None
        if isinstance(child, DictConfig):
            yield from _former_values(child, f"{path}{key}.")

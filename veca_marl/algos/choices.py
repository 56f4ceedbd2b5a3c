"""Registries of what a configuration chooses by name: algorithms, networks, intrinsic rewards.

Each entry is a dataclass of numbers, with its name in the field ``name``, and a factory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from veca_marl.registry import Registry, origin


class Named(Protocol):
    """Numbers that name the entry of a registry they belong to."""

    name: str


Numbers = TypeVar("Numbers", bound=Named)
Factory = TypeVar("Factory", bound=Callable[..., Any])


@dataclass(frozen=True)
class Choice(Generic[Numbers, Factory]):
    """An entry of a registry.

    Attributes:
        cfg_type: Dataclass of its numbers.
        factory: Makes it from its numbers, and from what the registry documents.
    """

    cfg_type: type[Numbers]
    factory: Factory


class ChoiceRegistry(Registry[Choice[Numbers, Factory]], Generic[Numbers, Factory]):
    """A registry of factories with the dataclasses of their numbers.

    Args:
        kind: What the entries are, in the singular; used in error messages.
        key: Key of the numbers in the configuration, such as ``algo.network``.
    """

    def __init__(self, kind: str, key: str) -> None:
        super().__init__(kind)
        self._key = key

    def register(self, name: str, cfg_type: type[Numbers], factory: Factory) -> None:
        """Add an entry. A definition that is executed again replaces the earlier one.

        Raises:
            ValueError: If another entry has the name, or the default of ``cfg_type.name`` differs.
        """
        present = self.get(name)
        if present is not None and origin(present.factory) != origin(factory):
            raise ValueError(
                f"{self.kind} {name!r} is defined twice: by {origin(present.factory)} and "
                f"{origin(factory)}"
            )
        default = getattr(cfg_type, "name", None)
        if default != name:
            raise ValueError(f"{cfg_type.__name__}.name is {default!r} by default, not {name!r}")
        self.add(name, Choice(cfg_type, factory))

    def factory_of(self, cfg: Numbers) -> Factory:
        """Return the factory of the entry that `cfg` names.

        Raises:
            ValueError: If there is none, or `cfg` is not of its type.
        """
        entry = self.find(cfg.name)
        if not isinstance(cfg, entry.cfg_type):
            raise ValueError(
                f"{self._key}.name={cfg.name} takes {entry.cfg_type.__name__}, "
                f"got {type(cfg).__name__}"
            )
        return entry.factory

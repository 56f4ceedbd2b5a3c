"""The interface of a learning algorithm, and registries that find one by name.

An algorithm learns one team from batches of experience. Everything around it (training loop,
evaluation, self-play, checkpoints, configuration) uses this interface and no other property of it.
Teams that learn at the same time each have an algorithm of their own, possibly different ones.

To add an algorithm: a dataclass of its numbers derived from `AlgorithmCfg`, a class derived from
`Algorithm`, and ``register_algorithm("name", MyCfg, MyAlgorithm)``.

Each entry of a registry is a dataclass of numbers, with its name in the field ``name``, and a
factory.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn

from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.sense_encoders import copy_encoders, copy_parameters
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.storage import StorageNeeded
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


@dataclass
class AlgorithmCfg:
    """Base class of the numbers of an algorithm.

    Attributes:
        name: Name of the algorithm in the registry.
    """

    name: str = ""

    def check_batch(self, worlds: int, steps: int) -> None:
        """Raise `ValueError` if batches of so many worlds and steps cannot be learnt from."""

    def check_budget(self, frames: int) -> None:
        """Raise `ValueError` if nothing is learnt from so many frames of a run."""


class Algorithm(ABC):
    """Learns one team.

    A constructor takes the name of the team, its `TeamSpec`, the numbers and the device:
    see `AlgorithmFactory`.

    Attributes:
        exact_resume: Whether a run that continues from `state_dict` gives the same parameters, bit
            for bit, as a run that was not interrupted. True only if `state_dict` contains
            everything that `learn` depends on (a replay buffer, for example); random numbers are
            seeded from (seed, stage) by the training loop.
        needs_experience: Whether it learns from batches that its policy collects. If no algorithm
            of a run does, no world is stepped for them, and batches are empty.
        needs_demonstrations: Whether it learns only after `take_demonstrations`.
        needs_labels: Whether batches have to hold what the expert would do: the key
            ``(team, "expert_action")``, of the form of the action.
    """

    exact_resume: bool
    needs_experience: ClassVar[bool] = True
    needs_demonstrations: ClassVar[bool] = False
    needs_labels: ClassVar[bool] = False

    @property
    @abstractmethod
    def actor(self) -> TensorDictModuleBase:
        """The policy: reads ``(team, "observation", ...)`` and writes the team's action.

        It follows TorchRL's `exploration_type`: the mode of its distribution where deterministic
        actions are asked for, a sample otherwise. A file for playing contains its `state_dict`.
        A policy with hidden state brings the primers of it (`networks.memory`).
        """

    @property
    def network_cfg(self) -> Any:
        """The `NetworkCfg` by which other algorithms compare its actor; None if it has none."""
        return None

    @property
    def policy_hidden(self) -> Sequence[int]:
        """Widths of the hidden layers of its actor, between features and policy heads."""
        return ()

    @property
    def explorer(self) -> TensorDictModuleBase:
        """The policy that collects experience; it contains `actor` if it is another module.

        Exploration noise and uniformly random actions at the start belong here; their schedules
        are kept in buffers, which reach the worker processes together with the parameters.
        """
        return self.actor

    @property
    @abstractmethod
    def measures(self) -> Sequence[str]:
        """Names of the numbers that `learn` returns, the same for each batch."""

    @property
    def storage_needed(self) -> StorageNeeded:
        """Memory and disk space that learning takes beside the parameters; none by default."""
        return StorageNeeded()

    @abstractmethod
    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from one batch and return the `measures`.

        Args:
            batch: Experience ``(worlds, steps)`` of all teams, on the CPU. Rows are consecutive
                steps of one world; flags are under ``("next", "done")`` and the team's own.
        """

    def take_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Learn from demonstrations too, from now on; called before learning begins or continues.

        Raises:
            ValueError: If the algorithm cannot learn from any: the default.
        """
        raise ValueError(f"{type(self).__name__} learns from experience only")

    def idle(self) -> dict[str, float]:
        """Return the `measures` of a batch that the team does not learn from: not a number."""
        return dict.fromkeys(self.measures, math.nan)

    @abstractmethod
    def state_dict(self) -> dict[str, Any]:
        """Return tensors and plain data from which `load_state_dict` continues."""

    @abstractmethod
    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""

    def load_learnt(self, state: dict[str, Any]) -> None:
        """Load what `init_from` of another algorithm copies out of a `state_dict`.

        This method loads everything. An algorithm with a large state beside its networks (a replay
        buffer) leaves that out.
        """
        self.load_state_dict(state)

    def init_from(self, other: Algorithm) -> None:
        """Copy the parameters of `other`, an algorithm from another run, before learning begins.

        Everything else (optimiser, replay buffer) starts from the beginning. This method copies
        the actor. An algorithm with further networks copies them too from one of its own kind,
        and makes copies (target networks) equal again.

        Raises:
            ValueError: If the parameters do not fit.
        """
        copy_parameters(self.actor, other.actor)

    def init_encoders(self, encoders: Mapping[str, Sequence[nn.Module]]) -> None:
        """Copy encoders of single senses, before learning begins.

        This method copies them to the encoders inside `actor`. An algorithm with encoders
        elsewhere, or with copies of them (target networks), overrides it.

        Args:
            encoders: Sense to one module, or to one for each agent; see `copy_encoders`.

        Raises:
            ValueError: If there is no encoder of a sense, or its parameters do not fit.
        """
        copy_encoders(self.actor, encoders)


AlgorithmFactory = Callable[[str, TeamSpec, Any, torch.device], Algorithm]


ALGORITHMS: ChoiceRegistry[AlgorithmCfg, AlgorithmFactory] = ChoiceRegistry("algorithm", "algo")
"""Algorithms by name; a factory takes (team, spec, numbers, device)."""


def register_algorithm(name: str, cfg_type: type[AlgorithmCfg], factory: AlgorithmFactory) -> None:
    """Make an algorithm known under `name`, the value of ``algo.name``.

    Raises:
        ValueError: If another algorithm has the name, or the default of ``cfg_type.name`` differs.
    """
    ALGORITHMS.register(name, cfg_type, factory)


def make_algorithm(team: str, spec: TeamSpec, cfg: AlgorithmCfg, device: torch.device) -> Algorithm:
    """Return the algorithm that `cfg` names, for one team.

    Raises:
        ValueError: If it is unknown, or `cfg` is not of its type.
    """
    return ALGORITHMS.factory_of(cfg)(team, spec, cfg, device)

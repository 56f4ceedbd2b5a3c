"""The interface of an intrinsic reward, and the registry that finds one by name.

An intrinsic reward is computed from a team's own experience, independent of its task and of the
algorithm that learns from it. To add one: a dataclass of its numbers derived from `IntrinsicCfg`, a
class derived from `IntrinsicReward`, and ``register_intrinsic("name", MyCfg, MyReward)``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from veca_marl.algos.algorithm import ChoiceRegistry
from veca_marl.algos.specs import TeamSpec

NONE = "none"  # the name of no intrinsic reward


@dataclass
class IntrinsicCfg:
    """Numbers of an intrinsic reward; the name ``none`` stands for the rewards of the task alone.

    Attributes:
        name: Name of the intrinsic reward in the registry, or ``none``.
        coefficient: Weight of the normalised intrinsic reward beside the reward of the task (0.5:
            the ratio of Burda et al. 2019, who clip rewards of the task to [-1, 1]).
        gamma: Discount of the returns that the intrinsic reward is normalised by.
    """

    name: str = NONE
    coefficient: float = 0.5
    gamma: float = 0.99

    def __post_init__(self) -> None:
        if not 0.0 <= self.coefficient < math.inf:
            raise ValueError(
                f"intrinsic.coefficient must be 0 or more and finite, got {self.coefficient}"
            )
        if not 0.0 <= self.gamma < 1.0:
            raise ValueError(f"intrinsic.gamma must be in [0, 1), got {self.gamma}")


class IntrinsicReward(ABC):
    """Rewards computed from one team's experience by a model that learns from it.

    A constructor takes the name of the team, its `TeamSpec`, the numbers and the device.
    """

    @property
    @abstractmethod
    def measures(self) -> Sequence[str]:
        """Names of the numbers that `learn` returns, the same for each batch."""

    @abstractmethod
    def learn(self, batch: TensorDictBase) -> tuple[Tensor, dict[str, float]]:
        """Return the rewards of a batch, computed before it is learnt from, and the `measures`.

        Args:
            batch: Experience ``(worlds, steps)``, on the CPU; see `Algorithm.learn`.

        Returns:
            Rewards ``(worlds, steps, agents, 1)``, 0 or more, in any unit, on the CPU; and name to
            number.
        """

    @abstractmethod
    def state_dict(self) -> dict[str, Any]:
        """Return tensors and plain data from which `load_state_dict` continues exactly."""

    @abstractmethod
    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""


IntrinsicFactory = Callable[[str, TeamSpec, Any, torch.device], IntrinsicReward]


INTRINSICS: ChoiceRegistry[IntrinsicCfg, IntrinsicFactory] = ChoiceRegistry(
    "intrinsic reward", "intrinsic"
)
"""Intrinsic rewards by name; a factory takes (team, spec, numbers, device)."""


def register_intrinsic(name: str, cfg_type: type[IntrinsicCfg], factory: IntrinsicFactory) -> None:
    """Make an intrinsic reward known under `name`, the value of ``intrinsic.name``.

    Raises:
        ValueError: If another one has the name, or the default of ``cfg_type.name`` differs.
    """
    INTRINSICS.register(name, cfg_type, factory)


def make_intrinsic(
    team: str, spec: TeamSpec, cfg: IntrinsicCfg, device: torch.device
) -> IntrinsicReward:
    """Return the intrinsic reward that `cfg` names, for one team.

    Raises:
        ValueError: If it is unknown, or `cfg` is not of its type.
    """
    return INTRINSICS.factory_of(cfg)(team, spec, cfg, device)

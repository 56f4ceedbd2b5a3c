"""What an algorithm may know of an environment: the arrays of each team, nothing else."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import torch
from torchrl.data import Bounded, Categorical, TensorSpec
from torchrl.envs import EnvBase


class EnvFactory(Protocol):
    """Makes environments; the only door through which an algorithm reaches a simulator."""

    def __call__(self, worlds: int, seed: int) -> EnvBase:
        """Return an environment of ``batch_size=[worlds]``, seeded."""
        ...


@dataclass(frozen=True)
class ArrayLayout:
    """One observation of one agent.

    Attributes:
        shape: Shape without batch and agent dimensions.
        dtype: Name of the torch type, such as ``uint8``.
        low: Least possible value, ``-inf`` if unbounded.
        high: Greatest possible value, ``inf`` if unbounded.
    """

    shape: tuple[int, ...]
    dtype: str
    low: float
    high: float


@dataclass(frozen=True)
class ActionLayout:
    """The action of one agent.

    Attributes:
        discrete: Whether one of `size` choices is taken, or `size` numbers in [-1, 1] are given.
        size: Number of choices or of numbers.
    """

    discrete: bool
    size: int


@dataclass(frozen=True)
class TeamSpec:
    """The arrays of one team, whose agents share them (and a policy).

    Attributes:
        agents: Number of agents.
        observations: Sense name to its layout.
        action: The action's layout.
        masked: Whether ``(team, "mask")`` says which agents still take part.
    """

    agents: int
    observations: dict[str, ArrayLayout]
    action: ActionLayout
    masked: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and strings, comparable after a round trip to disk."""
        plain = asdict(self)
        for layout in plain["observations"].values():
            layout["shape"] = list(layout["shape"])
        return plain


def team_specs(env: EnvBase) -> dict[str, TeamSpec]:
    """Read the layout of each team of `env` from its specs and its ``group_map``.

    Raises:
        ValueError: If an action is neither a bounded vector in [-1, 1] nor one choice.
    """
    batch_dims = len(env.batch_size)
    return {
        team: TeamSpec(
            agents=len(agents),
            observations={
                name: _array_layout(spec, batch_dims + 1)
                for name, spec in sorted(env.observation_spec[team, "observation"].items())
            },
            action=_action_layout(team, env.full_action_spec[team, "action"]),
            masked="mask" in env.observation_spec[team].keys(),  # noqa: SIM118  a spec
        )
        for team, agents in env.group_map.items()
    }


def _array_layout(spec: TensorSpec, leading: int) -> ArrayLayout:
    low, high = -math.inf, math.inf
    if isinstance(spec, Bounded):
        low, high = float(spec.space.low.min()), float(spec.space.high.max())
    return ArrayLayout(
        tuple(spec.shape[leading:]), str(spec.dtype).removeprefix("torch."), low, high
    )


def _action_layout(team: str, spec: TensorSpec) -> ActionLayout:
    if isinstance(spec, Categorical):
        return ActionLayout(discrete=True, size=int(spec.space.n))
    if isinstance(spec, Bounded) and spec.dtype.is_floating_point:
        unit = torch.ones(())
        if bool((spec.space.low == -unit).all()) and bool((spec.space.high == unit).all()):
            return ActionLayout(discrete=False, size=int(spec.shape[-1]))
    raise ValueError(
        f"team {team!r}: cannot learn the action {spec}; "
        "choices: Bounded in [-1, 1] (continuous), Categorical (discrete)"
    )

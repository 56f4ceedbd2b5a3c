"""What an algorithm may know of an environment: shapes, types and bounds of each team's arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import torch
from torchrl.data import Bounded, Categorical, Composite, TensorSpec
from torchrl.envs import EnvBase

# the part of an action that has no name: its key is (team, "action") itself
PLAIN = "action"
STATE = "state"  # at the root: what the simulator knows


class EnvFactory(Protocol):
    """Makes environments: the only access of an algorithm to a simulator."""

    def __call__(self, worlds: int, seed: int) -> EnvBase:
        """Return an environment of ``batch_size=[worlds]``, seeded."""
        ...


@dataclass(frozen=True)
class ArrayLayout:
    """One observation of one agent.

    Attributes:
        shape: Shape without batch and agent dimensions.
        dtype: Name of the torch type, such as ``uint8``.
        low: Lower bound of all entries, ``-inf`` if unbounded.
        high: Upper bound of all entries, ``inf`` if unbounded.
    """

    shape: tuple[int, ...]
    dtype: str
    low: float
    high: float

    @property
    def n_bytes(self) -> int:
        """Bytes of one array."""
        return math.prod(self.shape) * int(getattr(torch, self.dtype).itemsize)

    @property
    def is_image(self) -> bool:
        """Whether it is an image: bytes ``(..., channels, height, width)``."""
        return self.dtype == "uint8" and len(self.shape) >= 3


@dataclass(frozen=True)
class ActionLayout:
    """One part of the action of one agent.

    Attributes:
        discrete: True for one of `size` choices, False for a vector of `size` numbers in [-1, 1].
        size: Number of choices, or length of the vector.
    """

    discrete: bool
    size: int

    @property
    def dimensions(self) -> int:
        """How many independent numbers are drawn: one choice, or those of the vector."""
        return 1 if self.discrete else self.size


@dataclass(frozen=True)
class TeamSpec:
    """The arrays of one team; all its agents have the same ones.

    Attributes:
        agents: Number of agents.
        observations: Sense name to layout.
        actions: Part of the action to layout. An action without named parts has the single part
            `PLAIN`.
        masked: Whether ``(team, "mask")`` marks the agents that are not eliminated.
        state: Length of ``"state"``, what the simulator knows; 0 if there is none.
    """

    agents: int
    observations: dict[str, ArrayLayout]
    actions: dict[str, ActionLayout]
    masked: bool = False
    state: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and strings, comparable after a round trip to disk."""
        plain = asdict(self)
        if not self.state:  # as it was stored before there was one
            del plain["state"]
        for layout in plain["observations"].values():
            layout["shape"] = list(layout["shape"])
        return plain

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> TeamSpec:
        """Return what `to_dict` was called on.

        Raises:
            ValueError: If it is something else.
        """
        try:
            observations = {
                sense: ArrayLayout(**{**layout, "shape": tuple(layout["shape"])})
                for sense, layout in plain["observations"].items()
            }
            actions = {part: ActionLayout(**layout) for part, layout in plain["actions"].items()}
            spec = cls(**{**plain, "observations": observations, "actions": actions})
        except (LookupError, TypeError, AttributeError) as error:
            raise ValueError(f"no specification: {error!r}") from error
        spec._check_types()
        return spec

    def _check_types(self) -> None:
        sizes = [self.agents, self.state, *(part.size for part in self.actions.values())]
        sizes += [length for array in self.observations.values() for length in array.shape]
        bounds = [bound for a in self.observations.values() for bound in (a.low, a.high)]
        flags = [self.masked, *(part.discrete for part in self.actions.values())]
        dtypes = [array.dtype for array in self.observations.values()]
        kinds: list[tuple[list[Any], tuple[type, ...]]] = [
            (sizes, (int,)),
            (bounds, (int, float)),
            (flags, (bool,)),
            (dtypes, (str,)),
        ]
        for values, kind in kinds:
            if wrong := [value for value in values if type(value) not in kind]:
                raise ValueError(f"no specification: {wrong[0]!r:.80}, and no {kind[-1].__name__}")
        if min(sizes) < 0:
            raise ValueError(f"no specification: {min(sizes)} in place of a size")


def action_key(team: str, part: str) -> tuple[str, ...]:
    """Return the TensorDict key of one part of a team's action."""
    return (team, "action") if part == PLAIN else (team, "action", part)


def team_specs(env: EnvBase) -> dict[str, TeamSpec]:
    """Read the layout of each team of `env` from its specs and its ``group_map``.

    Raises:
        ValueError: If a part of an action is neither a vector in [-1, 1] nor one of n choices.
    """
    batch_dims = len(env.batch_size)
    state = env.observation_spec.get(STATE, None)
    return {
        team: TeamSpec(
            agents=len(agents),
            observations={
                name: _array_layout(spec, batch_dims + 1)
                for name, spec in sorted(env.observation_spec[team, "observation"].items())
            },
            actions=_action_layouts(team, env.full_action_spec[team, "action"]),
            masked="mask" in env.observation_spec[team].keys(),  # noqa: SIM118  a spec
            state=0 if state is None else int(state.shape[-1]),
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


def _action_layouts(team: str, spec: TensorSpec) -> dict[str, ActionLayout]:
    if not isinstance(spec, Composite):
        return {PLAIN: _action_layout(f"team {team!r}", spec)}
    return {
        name: _action_layout(f"team {team!r}, part {name!r} of the action", part)
        for name, part in sorted(spec.items())
    }


def _action_layout(owner: str, spec: TensorSpec) -> ActionLayout:
    if isinstance(spec, Categorical):
        return ActionLayout(discrete=True, size=int(spec.space.n))
    if isinstance(spec, Bounded) and spec.dtype.is_floating_point:
        unit = torch.ones(())
        if bool((spec.space.low == -unit).all()) and bool((spec.space.high == unit).all()):
            return ActionLayout(discrete=False, size=int(spec.shape[-1]))
    raise ValueError(
        f"{owner}: cannot learn {' '.join(str(spec).split())}; "
        "choices: Bounded in [-1, 1] (continuous), Categorical (discrete)"
    )

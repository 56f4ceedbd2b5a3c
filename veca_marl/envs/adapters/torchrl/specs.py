"""From the specs of senses and bodies to those of TorchRL, team by team."""

from __future__ import annotations

import numpy as np
import torch
from torchrl.data import Bounded, Categorical, Composite, TensorSpec, Unbounded

from veca_marl.envs.core.actions import ActionSpec, from_parts
from veca_marl.sim.spec import ArraySpec

DONE_KEYS = ("done", "terminated", "truncated")


def to_torchrl(spec: ArraySpec, batch: tuple[int, ...]) -> TensorSpec:
    """Translate one array; integers without shape are a choice among `high + 1`."""
    dtype = getattr(torch, np.dtype(spec.dtype).name)
    if spec.is_discrete:
        return Categorical(int(spec.high) + 1, shape=batch, dtype=dtype)
    shape = (*batch, *spec.shape)
    if np.isfinite(spec.low) and np.isfinite(spec.high):
        return Bounded(spec.low, spec.high, shape, dtype=dtype)
    return Unbounded(shape, dtype=dtype)


def observation_spec(
    senses: dict[str, ArraySpec], terms: tuple[str, ...], worlds: int, players: int
) -> Composite:
    """Return a team's `observation` and the `terms` of its reward."""
    batch = (worlds, players)
    return Composite(
        observation=Composite(
            {name: to_torchrl(spec, batch) for name, spec in senses.items()}, shape=batch
        ),
        terms=Composite({name: Unbounded((*batch, 1)) for name in terms}, shape=batch),
        shape=batch,
    )


def action_spec(parts: ActionSpec, batch: tuple[int, ...]) -> Composite:
    """Return a team's `action`: one leaf, or a composite of several named parts."""
    leaves = from_parts({part: to_torchrl(spec, batch) for part, spec in parts.items()})
    action = Composite(leaves, shape=batch) if isinstance(leaves, dict) else leaves
    return Composite(action=action, shape=batch)


def done_spec(batch: tuple[int, ...]) -> dict[str, TensorSpec]:
    """Return the three flags for a batch."""
    return {key: Categorical(2, shape=(*batch, 1), dtype=torch.bool) for key in DONE_KEYS}

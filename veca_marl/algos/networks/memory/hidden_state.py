"""Policies with hidden state: what an environment must carry for them from step to step.

A module with hidden state has a method ``make_tensordict_primer`` (as TorchRL's `LSTMModule` and
`GRUModule` have), which returns a `TensorDictPrimer` with the spec of the state. The module reads
the state, and ``"is_init"`` where an episode begins; it writes the new state under ``"next"``, and
the environment carries it on. When worlds are reset the primer writes the initial state in those
worlds alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from torch import nn
from torchrl.data import Composite, Unbounded
from torchrl.envs import Compose, EnvBase, InitTracker, TensorDictPrimer, Transform, TransformedEnv
from torchrl.modules.utils import get_primers_from_module


def memory_primer(
    team: str, agents: int, shapes: Mapping[str, tuple[int, ...]]
) -> TensorDictPrimer:
    """Return the primer of hidden states ``(team, "memory", name)``, zeros at the start.

    Args:
        team: Name of the team.
        agents: Number of its agents.
        shapes: Name to the shape of each agent's state.
    """
    lead = (agents,)  # the shape that everything of a team has
    states = {name: Unbounded((*lead, *shape)) for name, shape in shapes.items()}
    memory = Composite({"memory": Composite(states, shape=lead)}, shape=lead)
    return TensorDictPrimer(Composite({team: memory}), expand_specs=True)


def memory_of(policy: object) -> Compose | None:
    """Return the transform that carries the hidden state of `policy`; None if it has none.

    Args:
        policy: A module; any other callable has no hidden state.
    """
    primers = _primers_of(policy)
    if primers is None:
        return None
    for primer in _flat(primers):
        primer.reset_key = "_reset"  # worlds are reset as a whole, not team by team
    return Compose(InitTracker(), primers)


def memory_size(policy: object) -> int:
    """Return the number of floats in the hidden states of all agents of one world."""
    primers = _primers_of(policy)
    if primers is None:
        return 0
    states = [spec for primer in _flat(primers) for spec in primer.primers.values(True, True)]
    return sum(spec.shape.numel() for spec in states)


def with_memory(env: EnvBase, policy: object) -> EnvBase:
    """Return `env` with the transform that carries the state of `policy`, if it has one."""
    return with_transform(env, memory_of(policy))


def with_transform(env: EnvBase, transform: Compose | None) -> EnvBase:
    """Return `env` under a copy of `transform`, if there is one."""
    return env if transform is None else TransformedEnv(env, transform.clone())


def _primers_of(policy: object) -> Transform | None:
    if not isinstance(policy, nn.Module):
        return None
    primers: Transform | None = get_primers_from_module(policy, warn=False)
    return primers


def _flat(transform: Transform) -> list[TensorDictPrimer]:
    transforms = list(transform) if isinstance(transform, Compose) else [transform]
    return [each for each in transforms if isinstance(each, TensorDictPrimer)]

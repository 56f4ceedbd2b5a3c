"""Policies with hidden state: the state that environments carry, and a gated recurrent unit.

A module with hidden state has a method ``make_tensordict_primer`` (as TorchRL's `LSTMModule` and
`GRUModule` have), which returns a `TensorDictPrimer` with the spec of the state. The module reads
the state, and ``"is_init"`` where an episode begins; it writes the new state under ``"next"``, and
the environment carries it on. When worlds are reset the primer writes the initial state in those
worlds alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.data import Composite, Unbounded
from torchrl.envs import Compose, EnvBase, InitTracker, TensorDictPrimer, Transform, TransformedEnv
from torchrl.modules.tensordict_module.rnn import recurrent_mode
from torchrl.modules.utils import get_primers_from_module

from veca_marl.algos.acting import Arrays


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


def initial_states(policy: object, lead: tuple[int, ...]) -> dict[tuple[str, ...], Tensor]:
    """Return the hidden states with which `policy` begins, by their keys; empty if it has none.

    Args:
        policy: A module.
        lead: Shape before that of the state of one world, such as ``(rows, time)``.
    """
    primers = _primers_of(policy)
    if primers is None:
        return {}
    return {
        key: torch.zeros(*lead, *spec.shape)
        for primer in _flat(primers)
        for key, spec in primer.primers.items(True, True)
    }


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


class GatedMemory(nn.Module):
    """Features and the state before a step to the state after it, which is also the output.

    TorchRL's `GRUModule` expects time as the last dimension before the features, where a team has
    its agents, and resets a state where an episode begins, not where an agent is eliminated.

    Source: Cho et al. 2014, "Learning phrase representations using RNN encoder-decoder", in the
    form of `torch.nn.GRU`.

    Args:
        inputs: Length of the features.
        size: Length of the state.
    """

    def __init__(self, inputs: int, size: int) -> None:
        super().__init__()
        self.gru = nn.GRU(inputs, size)
        for name, parameter in self.gru.named_parameters():
            if name.startswith("weight"):
                nn.init.orthogonal_(parameter)
            else:
                nn.init.zeros_(parameter)

    def forward(
        self, features: Tensor, state: Tensor, begins: Tensor, present: Tensor | None = None
    ) -> Tensor:
        """Return the states after the steps, ``(..., agents, size)``.

        In TorchRL's recurrent mode the leading dimensions are ``(rows, time)``: the stored state is
        read at the first step of each row and where an episode begins (as by TorchRL's modules),
        and gradients flow through the steps between. Otherwise every entry is a step by itself.

        Args:
            features: ``(..., agents, inputs)``.
            state: Stored state before each step, ``(..., agents, size)``; zeros where an episode
                begins.
            begins: Whether the step is the first of its episode. ``(..., agents, 1)``.
            present: Whether the agent is not eliminated; if it is, the state after the step is
                zero. ``(..., agents, 1)``; None if agents are never eliminated.
        """
        if recurrent_mode():
            resets = begins if present is None else begins | _returns(present)
            after = self._sequences(features, state, resets)
        else:
            after = self._steps(features, state)
        return after if present is None else after.masked_fill(~present, 0.0)

    def _steps(self, features: Tensor, before: Tensor) -> Tensor:
        after: Tensor = self.gru(features.flatten(0, -2)[None], before.flatten(0, -2)[None])[1]
        return after.view_as(before)

    def _sequences(self, features: Tensor, state: Tensor, resets: Tensor) -> Tensor:
        """Unroll pieces of time in which no state is reset; most sequences are one piece."""
        time, agents = features.shape[1:3]
        features, state, resets = (
            x.transpose(0, 1).flatten(1, 2) for x in (features, state, resets)
        )
        starts = [t for t, reset in enumerate(resets.flatten(1).any(1).tolist()) if reset or t == 0]
        before, pieces = state[:1], []
        for start, end in pairwise([*starts, time]):
            before = torch.where(resets[start], state[start], before)
            piece, before = self.gru(features[start:end], before)
            pieces.append(piece)
        states: Tensor = torch.cat(pieces).unflatten(1, (-1, agents)).transpose(0, 1)
        return states


def _returns(present: Tensor) -> Tensor:
    """Return where an agent is present after a step in which it was not, ``(rows, time, ...)``."""
    returns = torch.zeros_like(present)
    returns[:, 1:] = present[:, 1:] & ~present[:, :-1]
    return returns


def state_alone(features: Tensor, state: Tensor) -> Tensor:
    """Return the state: the heads read nothing else."""
    return state


def features_and_state(features: Tensor, state: Tensor) -> Tensor:
    """Return the features followed by the state.

    Source: Ni et al. 2022, "Recurrent model-free RL can be a strong baseline for many POMDPs",
    whose heads read the encoded observation in addition to the state.
    """
    return torch.cat([features, state], dim=-1)


class TeamMemory(TensorDictModuleBase):
    """Applies a `GatedMemory` to ``(team, "features")`` and writes what the heads read to that key.

    Args:
        team: Name of the team.
        agents: Number of its agents.
        size: Length of the state of each agent.
        masked: Whether agents can be eliminated: ``(team, "mask")``.
        output: What the heads read, from the features and the state after the step.
        memory: Has the arguments of `GatedMemory.forward`; for all agents or one of its own for
            each of them.
    """

    def __init__(
        self,
        team: str,
        agents: int,
        size: int,
        masked: bool,
        output: Callable[[Tensor, Tensor], Tensor],
        memory: nn.Module,
    ) -> None:
        super().__init__()
        self.team, self.agents, self.size, self.masked = team, agents, size, masked
        self.output, self.memory = output, memory
        self.features, self.state = (team, "features"), (team, "memory", "hidden")
        self.in_keys = [self.features, self.state, "is_init", *([(team, "mask")] if masked else [])]
        self.out_keys = [self.features, ("next", *self.state)]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write features and next state, and return `tensordict`."""
        self.write(tensordict)
        return tensordict

    def write(self, arrays: Arrays) -> None:
        """See `acting.WritesArrays`."""
        features, state = arrays[self.features], arrays[self.state]
        begins = arrays["is_init"].unsqueeze(-2).expand(*features.shape[:-1], 1)
        present = [arrays[self.team, "mask"].unsqueeze(-1)] if self.masked else []
        after = self.memory(features, state, begins, *present)
        arrays["next", *self.state] = after
        arrays[self.features] = self.output(features, after)

    def make_tensordict_primer(self) -> TensorDictPrimer:
        """Return the transform with the spec of the state (see `networks.memory`)."""
        return memory_primer(self.team, self.agents, {"hidden": (self.size,)})

"""Policies in the form in which they act: without gradients, on the few observations of a step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, MutableMapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Protocol, runtime_checkable

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import (
    ProbabilisticTensorDictModule,
    ProbabilisticTensorDictSequential,
    TensorDictModule,
    TensorDictModuleBase,
    TensorDictSequential,
)
from torch import Tensor
from torch.distributions import Categorical
from torch.nn.functional import softplus
from torchrl.envs import ExplorationType
from torchrl.envs.utils import exploration_type

Key = str | tuple[str, ...]
Arrays = MutableMapping[Any, Any]  # `Key` to `Tensor`: a dict, or a TensorDict


Draw = Callable[..., tuple[Tensor, Tensor]]

_LOG_ROOT_2_PI = math.log(math.sqrt(2.0 * math.pi))
_LOG_2 = math.log(2.0)


@dataclass(frozen=True)
class DrawnPart:
    """A part of an action.

    Attributes:
        draw: Returns action and log-probability; its arguments are whether to sample, and the
            parameters of the distribution.
        parameters: Keys of the parameters.
        action: Key of the action.
        log_prob: Key of its log-probability.
    """

    draw: Draw
    parameters: tuple[Key, ...]
    action: Key
    log_prob: Key

    def write(self, arrays: Arrays, sampled: bool) -> None:
        """Write action and log-probability."""
        parameters = (arrays[key] for key in self.parameters)
        arrays[self.action], arrays[self.log_prob] = self.draw(sampled, *parameters)


def draw_tanh_normal(sampled: bool, loc: Tensor, scale: Tensor) -> tuple[Tensor, Tensor]:
    """Return action ``(..., A)`` in (-1, 1) and log-probability ``(...)``.

    These are the operations of TorchRL's `TanhNormal` on [-1, 1] in their order: the same seed
    gives the same bits. Making that object and calling its transforms takes four times as long.

    Args:
        sampled: Whether to sample; otherwise the action is tanh(loc).
        loc: Mean of the normal distribution before tanh, ``(..., A)``.
        scale: Its standard deviation.
    """
    limit = 1.0 - torch.finfo(loc.dtype).resolution
    noise = torch.normal(torch.zeros_like(loc), torch.ones_like(loc)) if sampled else None
    action = (loc if noise is None else loc + noise * scale).tanh().clamp(-limit, limit)
    normal = action.atanh()  # from the action as it is stored, as a loss computes it
    density = -((normal - loc) ** 2) / (2 * scale**2) - scale.log() - _LOG_ROOT_2_PI
    jacobian = 2.0 * (_LOG_2 - normal - softplus(-2.0 * normal))
    return action, density.sum(-1) - jacobian.sum(-1)


def draw_categorical(sampled: bool, logits: Tensor) -> tuple[Tensor, Tensor]:
    """Return choice ``(...)`` int64 and log-probability ``(...)``.

    Args:
        sampled: Whether to sample; otherwise it is the most likely choice.
        logits: ``(..., choices)``.
    """
    distribution = Categorical(logits=logits, validate_args=False)
    choice = distribution.sample() if sampled else distribution.mode
    return choice, distribution.log_prob(choice)


# a distribution that is asked for nothing takes the deterministic action, as TensorDict's does
SAMPLED = {ExplorationType.RANDOM: True, ExplorationType.DETERMINISTIC: False, None: False}


@runtime_checkable
class WritesArrays(Protocol):
    """A `TensorDictModuleBase` that does not need a TensorDict: a dict with its keys will do."""

    def write(self, arrays: Arrays) -> None:
        """Read the arrays of the module's ``in_keys`` and write those of its ``out_keys``."""
        ...


class ArrayModule(TensorDictModule):
    """A `TensorDictModule` of which the module maps arrays to an array, or to a tuple of them.

    `TensorDictModule.forward` converts each array by `TensorDict.from_any`, which searches the
    path for pandas and takes 0.05 ms where it is not installed.
    """

    def forward(self, tensordict: TensorDictBase, **options: Any) -> TensorDictBase:
        """Write the outputs into `tensordict` and return it; for `options` see the base class."""
        if options:
            written: TensorDictBase = super().forward(tensordict, **options)
            return written
        self.write(tensordict)
        return tensordict

    def write(self, arrays: Arrays) -> None:
        """See `WritesArrays`."""
        written = self.module(*(arrays[key] for key in self.in_keys))
        outputs = written if isinstance(written, tuple) else (written,)
        for key, array in zip(self.out_keys, outputs, strict=True):
            arrays[key] = array


class ActionDistribution(ProbabilisticTensorDictModule):
    """A distribution from which actions can be drawn without constructing its object.

    Args:
        parts: The parts of the action, which are independent given the parameters.
        **options: As for `ProbabilisticTensorDictModule`.
    """

    def __init__(self, parts: Sequence[DrawnPart], **options: Any) -> None:
        super().__init__(**options, return_log_prob=True)
        self._parts = tuple(parts)

    def write(self, arrays: Arrays) -> None:
        """See `WritesArrays`; for samples and deterministic actions alone."""
        for part in self._parts:
            part.write(arrays, SAMPLED[exploration_type()])


class DirectPolicy(TensorDictModuleBase):
    """Gives the results of a policy with a fraction of its overhead.

    The modules of the policy exchange their arrays in a dict, and the TensorDict receives them at
    the end. Of 4 observations of the default network this halves the time of a call. A module that
    is not of the kind `WritesArrays` is called with a TensorDict of its inputs.

    Args:
        policy: A module, or a sequence of modules.
    """

    def __init__(self, policy: TensorDictModuleBase) -> None:
        super().__init__()
        self.policy = policy
        self.out_keys = list(policy.out_keys)
        # a distribution of several parts reads the node above the parameters that are written
        self.in_keys = [k for k in policy.in_keys if not any(_within(o, k) for o in self.out_keys)]
        self._steps = [(module, isinstance(module, WritesArrays)) for module in _flat(policy)]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write what the policy writes, and return `tensordict`."""
        if exploration_type() not in SAMPLED:  # a median, for instance
            written: TensorDictBase = self.policy(tensordict)
            return written
        arrays: Arrays = {key: tensordict[key] for key in self.in_keys}
        for module, writes in self._steps:
            if writes:
                module.write(arrays)
            else:
                _call(module, arrays, tensordict.batch_size)
        for key in self.out_keys:
            tensordict.set(key, arrays[key])
        return tensordict


def _call(module: TensorDictModuleBase, arrays: Arrays, batch_size: torch.Size) -> None:
    inputs = TensorDict({}, batch_size)
    for key, array in arrays.items():
        if any(key == node or _within(key, node) for node in module.in_keys):
            inputs.set(key, array)
    outputs = module(inputs)
    arrays.update((key, outputs[key]) for key in module.out_keys)


def _within(key: Key, node: Key) -> bool:
    """Return whether `key` is below `node`, as ``("a", "b")`` is below ``"a"``."""
    node = (node,) if isinstance(node, str) else node
    return len(key) > len(node) and isinstance(key, tuple) and key[: len(node)] == node


def _flat(policy: TensorDictModuleBase) -> Iterator[TensorDictModuleBase]:
    """Yield the modules of nested sequences, as far as these pass on all that is written."""
    if type(policy) in (TensorDictSequential, ProbabilisticTensorDictSequential):
        written = {*chain.from_iterable(module.out_keys for module in policy.module)}
        if written == {*policy.out_keys} and not policy.partial_tolerant:
            for module in policy.module:
                yield from _flat(module)
            return
    yield policy

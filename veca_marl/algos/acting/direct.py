"""A policy that calls its modules without a TensorDict between them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import (
    ProbabilisticTensorDictSequential,
    TensorDictModuleBase,
    TensorDictSequential,
)
from torchrl.envs.utils import exploration_type

from veca_marl.algos.acting.keys import Arrays, Key
from veca_marl.algos.acting.modules import SAMPLED, WritesArrays


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

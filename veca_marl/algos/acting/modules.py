"""Modules that read and write arrays by their keys, in a TensorDict or in a dict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

from tensordict import TensorDictBase
from tensordict.nn import ProbabilisticTensorDictModule, TensorDictModule
from torchrl.envs import ExplorationType
from torchrl.envs.utils import exploration_type

from veca_marl.algos.acting.draws import DrawnPart
from veca_marl.algos.acting.keys import Arrays

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

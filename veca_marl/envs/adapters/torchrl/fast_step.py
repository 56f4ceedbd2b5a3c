"""A shorter path around each step, for an environment whose data always have the same layout.

TorchRL serves environments whose keys and shapes may change from step to step: after each step it
completes missing flags, compares shapes (`EnvBase._step_proc_data`), and finds out which keys the
next step starts from (`EnvBase._step_mdp`). For a game of 2 ms that is a tenth of the time.
`FastStepEnv` knows the layout from its specs. Its results are those of TorchRL's own code, which
stays in use for whatever is not a plain `TensorDict`.

The two methods are not part of TorchRL's documented interface: with a version that was not tested,
TorchRL's own code is used, see `private_parts`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite
from torchrl.envs import EnvBase

from veca_marl.private_parts import torchrl_is_tested


class FastStepEnv(EnvBase):
    """An `EnvBase` whose `_step` returns all keys of its specs, in their shapes, at every step.

    Args:
        fast_step: Whether to use the shorter path, if this version of TorchRL was tested; False is
            TorchRL's own code.
        batch_size: As for `EnvBase`.
    """

    def __init__(self, fast_step: bool, batch_size: torch.Size) -> None:
        super().__init__(device=None, batch_size=batch_size)
        self._fast_step = fast_step and torchrl_is_tested()
        self._next_state: NextState | None = None

    def _step_proc_data(self, next_tensordict_out: TensorDictBase) -> TensorDictBase:
        """Return the data as they are: `_step` returns all flags in their shapes."""
        if self._fast_step and not self.run_type_checks:
            return next_tensordict_out
        return super()._step_proc_data(next_tensordict_out)

    @property
    def _step_mdp(self) -> Callable[[TensorDictBase], TensorDictBase]:
        # TorchRL caches it until the specs change
        general: Callable[[TensorDictBase], TensorDictBase] = super()._step_mdp
        if not self._fast_step:
            return general
        if self._next_state is None or self._next_state.general is not general:
            specs = self.observation_spec, self.full_done_spec, self.full_reward_spec
            self._next_state = NextState(general, *specs)
        return self._next_state


class _Plan(NamedTuple):
    """How one level of nested tensordicts changes from one step to the next.

    Attributes:
        replaced: Names that do not stay: those of `taken` and `inner`, and what ends with the step.
        taken: Names that come from `next`.
        inner: The levels below.
    """

    replaced: frozenset[str]
    taken: tuple[str, ...]
    inner: dict[str, _Plan]


class _NotPlainError(Exception):
    """The data are not a plain `TensorDict`."""


class NextState:
    """Computes the tensordict from which the next step starts, as TorchRL's `_StepMDP` does.

    Observations and flags come from `next`, rewards are dropped, and everything else stays: the
    action, and what a policy wrote.

    Args:
        general: TorchRL's own, for data that are not plain.
        observation: Spec of the observations.
        done: Spec of the flags.
        reward: Spec of the rewards.
    """

    def __init__(
        self,
        general: Callable[[TensorDictBase], TensorDictBase],
        observation: Composite,
        done: Composite,
        reward: Composite,
    ) -> None:
        self.general = general
        plan = _plan(observation, done, reward)
        self._plan = plan._replace(replaced=plan.replaced | {"next"})

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Return a new tensordict with the same tensors."""
        try:
            if any(tensordict.names):
                raise _NotPlainError
            return _merged(self._plan, tensordict, tensordict.get("next", None))
        except (_NotPlainError, KeyError):  # TorchRL's own code reports a missing key
            return self.general(tensordict)


def _plan(*specs: Composite | None) -> _Plan:
    """Return the plan of a level from the specs of observations, flags and rewards there."""
    observation, done, reward = (dict(spec.items()) if spec is not None else {} for spec in specs)
    nested = [
        name for name, spec in (observation | done | reward).items() if isinstance(spec, Composite)
    ]
    ends = {"_reset"} if done else set()
    return _Plan(
        replaced=frozenset(ends.union(observation, done, reward)),
        taken=tuple(name for name in observation | done if name not in nested),
        inner={
            name: _plan(observation.get(name), done.get(name), reward.get(name)) for name in nested
        },
    )


def _merged(plan: _Plan, now: Any, following: Any) -> TensorDict:
    if type(now) is not TensorDict or type(following) is not TensorDict:
        raise _NotPlainError
    present, given = dict(now.items()), dict(following.items())
    fields = {
        name: value if isinstance(value, torch.Tensor) else value.copy()
        for name, value in present.items()
        if name not in plan.replaced
    }
    for name in plan.taken:
        fields[name] = given[name]
    for name, inner in plan.inner.items():
        fields[name] = _merged(inner, present.get(name), given.get(name))
    return TensorDict._new_unsafe(fields, now.batch_size, now.device)


Arrays = dict[str, Any]  # name -> array, or name -> Arrays


class Layout:
    """The names, shapes and types of one step's data, read from a spec once.

    Args:
        spec: Spec of a tensordict with this layout.
    """

    def __init__(self, spec: Composite) -> None:
        self._batch = spec.shape
        self._inner: dict[str, Layout] = {}
        self._leaves: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {}
        for name, entry in spec.items():
            if isinstance(entry, Composite):
                self._inner[name] = Layout(entry)
            else:
                self._leaves[name] = (
                    tuple(entry.shape),
                    torch.empty(0, dtype=entry.dtype).numpy().dtype,
                )

    def new(self) -> Arrays:
        """Return new arrays of zeros: what was returned for earlier steps must not change."""
        arrays: Arrays = {name: np.zeros(*leaf) for name, leaf in self._leaves.items()}
        for name, layout in self._inner.items():
            arrays[name] = layout.new()
        return arrays

    def copy_rows(self, source: TensorDictBase, arrays: Arrays, rows: list[int]) -> None:
        """Copy rows of the leaves of this layout that `source` contains.

        Args:
            source: Where to copy from.
            arrays: What `new` returned.
            rows: Indices along the first axis.
        """
        for name in self._leaves:
            value = source.get(name, None)
            if value is not None:
                arrays[name][rows] = value[rows].numpy(force=True)
        for name, layout in self._inner.items():
            inner = source.get(name, None)
            if inner is not None:
                layout.copy_rows(inner, arrays[name], rows)

    def tensordict(self, arrays: Arrays, device: torch.device | None = None) -> TensorDict:
        """Return the arrays as tensors.

        Args:
            arrays: What `new` returned. The tensors share its memory if they stay on the CPU.
            device: Where the tensors go; None is the CPU, and a tensordict without a device.
        """
        tensordict = self._wrapped(arrays)
        return tensordict if device is None else tensordict.to(device)

    def _wrapped(self, arrays: Arrays) -> TensorDict:
        tensors: Arrays = {name: torch.from_numpy(arrays[name]) for name in self._leaves}
        for name, layout in self._inner.items():
            tensors[name] = layout._wrapped(arrays[name])
        # the shapes come from the spec: the constructor would compare each tensor with the batch
        # size again, which costs a third of the time that VecaEnv adds to the games
        if torchrl_is_tested():
            return TensorDict._new_unsafe(tensors, self._batch)
        return TensorDict(tensors, self._batch)

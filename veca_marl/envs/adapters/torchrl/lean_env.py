"""What TorchRL does round every step, for an environment whose data never change their layout.

`EnvBase` serves environments whose keys and shapes may change from step to step, and looks at each
of them again at every step. In a game of 1 ms that is a tenth of all. Here only what may be
different is looked at; whatever is not a plain `TensorDict` goes TorchRL's own way. The results are
the same: tests hold them together, and fail when TorchRL's own code changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite
from torchrl.envs import EnvBase


class LeanEnv(EnvBase):
    """An `EnvBase` whose `_step` returns all keys of its specs, in their shapes, at every step.

    Flags must stand at the root.
    """

    _onward: Onward | None = None

    def _step_proc_data(self, next_tensordict_out: TensorDictBase) -> TensorDictBase:
        """Leave out TorchRL's completion of flags and shapes: `_step` returns all of them."""
        if self.run_type_checks:
            return super()._step_proc_data(next_tensordict_out)
        return next_tensordict_out

    def any_done(self, tensordict: TensorDictBase) -> bool:
        """See `EnvBase.any_done`; a list of a few flags is looked through faster than a tensor."""
        done = tensordict.get("done", None)
        if done is not None and done.ndim == 2 and done.is_cpu and [True] not in done.tolist():
            return False
        return bool(super().any_done(tensordict))

    @property
    def _step_mdp(self) -> Callable[[TensorDictBase], TensorDictBase]:
        general = super()._step_mdp  # TorchRL keeps it as long as the specs stay
        if self._onward is None or self._onward.general is not general:
            specs = self.observation_spec, self.full_done_spec, self.full_reward_spec
            self._onward = Onward(general, *specs)
        return self._onward


class _Plan(NamedTuple):
    """What becomes of one level of nested tensordicts from one step to the next.

    Attributes:
        replaced: Names that do not simply stay: those of the next two, and what ends with the step.
        taken: Names that come from `next`.
        inner: The levels below.
    """

    replaced: frozenset[str]
    taken: tuple[str, ...]
    inner: dict[str, _Plan]


class _NotPlainError(Exception):
    """Something is no plain `TensorDict`."""


class Onward:
    """What TorchRL's `_StepMDP` does: the tensordict from which the next step starts.

    Observations and flags come from `next`, rewards end with the step, and all else stays: the
    action, what a policy wrote.

    Args:
        general: TorchRL's own, for whatever is not plain.
        observation: Spec of what is observed.
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
        """Return a new tensordict on the same tensors."""
        try:
            if any(tensordict.names):
                raise _NotPlainError
            return _merged(self._plan, tensordict, tensordict.get("next", None))
        except (_NotPlainError, KeyError):  # a key of the specs may be missing: TorchRL says how
            return self.general(tensordict)


def _plan(*specs: Composite | None) -> _Plan:
    """Make the plan of a level from the specs of observations, flags and rewards there."""
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


def _merged(
    plan: _Plan, now: TensorDictBase | None, following: TensorDictBase | None
) -> TensorDict:
    if type(now) is not TensorDict or type(following) is not TensorDict:
        raise _NotPlainError
    held, given = dict(now.items()), dict(following.items())
    fields = {
        name: value if isinstance(value, torch.Tensor) else value.copy()
        for name, value in held.items()
        if name not in plan.replaced
    }
    for name in plan.taken:
        fields[name] = given[name]
    for name, inner in plan.inner.items():
        fields[name] = _merged(inner, held.get(name), given.get(name))
    return TensorDict._new_unsafe(fields, now.batch_size, now.device)

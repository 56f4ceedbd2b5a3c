"""Groups of worlds: what experience depends on, whatever processes play them.

The worlds of a run are numbered, and divided into groups of consecutive worlds. One call of the
policy acts for one group, with random numbers of the group's own; a process plays one group or
several. So neither random numbers nor the shapes of the arithmetic depend on the number of
processes, and experience is the same, byte for byte.
"""

from __future__ import annotations

from typing import Any, cast

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.collectors import Collector

from veca_marl.algos.seeds import derived_seed, seed_worlds


class GroupedPolicy(TensorDictModuleBase):
    """A policy that acts for one group of worlds after the other, each with its own random numbers.

    Torch's random numbers go on afterwards as if it had drawn none.

    Args:
        policy: Writes actions.
        groups: Number of groups; it divides the number of worlds.

    Attributes:
        groups: As given.
    """

    def __init__(self, policy: TensorDictModuleBase, groups: int) -> None:
        super().__init__()
        self.policy, self.groups = policy, groups
        # policies without keys, such as TorchRL's `RandomPolicy`, write new tensors
        self.in_keys = getattr(policy, "in_keys", [])
        self.out_keys = getattr(policy, "out_keys", [])
        self._states: list[Tensor] = [torch.get_rng_state()] * groups

    def seed(self, seed: int, first_group: int) -> None:
        """Seed the random numbers of all groups; `first_group` is the number of the first one."""
        generator = torch.Generator()
        for group in range(self.groups):
            generator.manual_seed(derived_seed(seed, first_group + group))
            self._states[group] = generator.get_state()

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of all worlds."""
        before = torch.get_rng_state()
        try:
            if self.groups == 1:
                return self._act(0, tensordict)
            # copies, because libraries may compute otherwise where memory is aligned otherwise
            parts = [part.clone() for part in tensordict.chunk(self.groups, 0)]
            written = [self._written(group, part) for group, part in enumerate(parts)]
            return tensordict.update(torch.cat(written, 0))
        finally:
            torch.set_rng_state(before)

    def _written(self, group: int, tensordict: TensorDictBase) -> TensorDictBase:
        """Return what the policy writes for a group: its keys, and what else is new."""
        before = dict(tensordict.items(True, True))
        acted, own = self._act(group, tensordict), set(self.out_keys)
        read = [k for k, v in acted.items(True, True) if k not in own and v is before.get(k)]
        return acted.exclude(*read)

    def _act(self, group: int, tensordict: TensorDictBase) -> TensorDictBase:
        torch.set_rng_state(self._states[group])
        acted: TensorDictBase = self.policy(tensordict)
        self._states[group] = torch.get_rng_state()
        return acted


class GroupCollector(Collector):
    """TorchRL's collector of the groups of one process; its policy is a `GroupedPolicy`.

    Args:
        *args: As for `Collector`.
        process: Index of the process.
        **kwargs: As for `Collector`.
    """

    def __init__(self, *args: Any, process: int = 0, **kwargs: Any) -> None:
        self._process = process
        super().__init__(*args, **kwargs)

    def set_seed(self, seed: int, static_seed: bool = False) -> int:
        """Seed the worlds and the policy of this process; return the seed, which all have."""
        policy = cast(GroupedPolicy, self.policy)
        seed_worlds(self.env, seed, self._process * self.env.batch_size[0])
        policy.seed(seed, self._process * policy.groups)
        return seed

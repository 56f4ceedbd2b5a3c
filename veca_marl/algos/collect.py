"""Where experience comes from: worlds in this process, or in several."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from functools import partial

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import multiprocessing
from torchrl.collectors import Collector, MultiSyncCollector

from veca_marl.algos.specs import EnvFactory


@dataclass
class CollectCfg:
    """How many worlds play at once; processes x worlds are the paper's 8 workers.

    Attributes:
        processes: Worker processes; 0 plays in this one.
        worlds: Worlds in each process; they share one policy call.
        steps: Steps of each world in a batch.
        threads: Torch threads of each worker process.
    """

    processes: int = 2
    worlds: int = 4
    steps: int = 256
    threads: int = 1

    def __post_init__(self) -> None:
        if self.processes < 0:
            raise ValueError(f"collect.processes must be 0 or more, got {self.processes}")
        for name in ("worlds", "steps", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"collect.{name} must be at least 1, got {getattr(self, name)}")

    @property
    def frames(self) -> int:
        """Frames in a batch."""
        return max(self.processes, 1) * self.worlds * self.steps


class Experience:
    """Batches of ``(worlds, steps)`` played by `policy`, restartable from a seed.

    Args:
        make_env: Makes the worlds.
        policy: Writes actions. A copy of it on the CPU plays, wherever the original learns; its
            parameters follow at `update_policy` and not before.
        cfg: How many worlds, where.
    """

    def __init__(self, make_env: EnvFactory, policy: TensorDictModuleBase, cfg: CollectCfg) -> None:
        self.cfg = cfg
        self._source = policy
        self._policy = deepcopy(policy).to("cpu")
        make = partial(make_env, cfg.worlds, 0)  # seeded by `restart`
        common = {
            "frames_per_batch": cfg.frames,
            "total_frames": -1,
            "auto_register_policy_transforms": False,
        }
        if cfg.processes == 0:
            self._collector = Collector(make, self._policy, **common)
        else:
            threads = torch.get_num_threads()
            with _quiet_workers():
                self._collector = MultiSyncCollector(
                    [make] * cfg.processes,
                    self._policy,
                    cat_results="stack",
                    num_threads=threads,
                    num_sub_threads=cfg.threads,
                    **common,
                )
        self._batches: Iterator[TensorDictBase] = iter(self._collector)

    def restart(self, seed: int) -> None:
        """Start new episodes in all worlds; all that follows depends on `seed` alone."""
        torch.manual_seed(seed)
        self._collector.set_seed(seed)
        self._collector.reset()

    def collect(self) -> TensorDictBase:
        """Play on and return the next batch, ``(processes * worlds, steps)``."""
        batch = next(self._batches)
        return batch if batch.ndim == 2 else batch.flatten(0, 1)

    def update_policy(self) -> None:
        """Hand the policy's new parameters to the worlds."""
        with torch.no_grad():
            pairs = zip(self._policy.parameters(), self._source.parameters(), strict=True)
            for mine, learnt in pairs:
                mine.copy_(learnt)
        self._collector.update_policy_weights_()

    def close(self) -> None:
        """End the worker processes and close the worlds."""
        self._collector.shutdown()


@contextmanager
def _quiet_workers() -> Iterator[None]:
    """Fork workers that ignore Ctrl-C: this process hears it and ends them in order."""
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    multiprocessing.set_start_method("fork", force=True)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)

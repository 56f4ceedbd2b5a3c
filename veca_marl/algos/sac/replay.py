"""The replay buffer of one team: TorchRL's, filled with segments and sampled in windows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers import Sequence

from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.sac.segments import END, Key, StoredKeys, segment_rows
from veca_marl.algos.sac.windows import Windows
from veca_marl.algos.specs import TeamSpec


class Replay:
    """Stores each observation once and returns windows of consecutive rows.

    Storage and ring are TorchRL's, and so are the windows (`Sequence`). Rows are read by
    `index_select`, which copies images 5 times as fast as the indexing of
    `TensorDictReplayBuffer.sample`, and of a window only the observations that are needed.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: Size.
        steps: Steps of a window.

    Attributes:
        frames: Frames that were ever added.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: ReplayCfg, steps: int) -> None:
        self.cfg, self.frames = cfg, 0
        self._keys = StoredKeys.of(team, spec)
        self._storage = LazyTensorStorage(cfg.capacity)
        self._buffer = TensorDictReplayBuffer(storage=self._storage)
        # one row more than steps: the observation that follows the last one
        self._unit = Sequence(length=1, bootstrap=steps, done_key=END)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._buffer)

    @property
    def ready(self) -> bool:
        """Whether there are enough rows to learn from."""
        return len(self) >= max(self.cfg.warm_up_frames, 1)

    def extend(self, batch: TensorDictBase) -> None:
        """Add a batch ``(worlds, steps)``."""
        self._buffer.extend(segment_rows(batch, self._keys))
        self.frames += batch.numel()

    def sample(self, windows: int) -> Windows:
        """Return uniformly drawn windows."""
        index, info = self._unit.expand(torch.randint(len(self), (windows,)), {}, self._storage)
        index = index.view(windows, -1)
        keys, steps = self._keys, index[:, :-1]
        return Windows(
            first=self._rows((*keys.state, *keys.action), index[:, 0]),
            last=self._rows(keys.state, index[:, -1]),
            reward=self._column((keys.team, "reward"), steps).squeeze(-1),
            terminated=self._column((keys.team, "terminated"), steps).squeeze(-1),
            took_place=info["validity_mask"].view(windows, -1)[:, 1:],
        )

    def _rows(self, keys: Iterable[Key], index: Tensor) -> TensorDict:
        rows = TensorDict({}, index.shape)
        for key in keys:
            rows[key] = self._column(key, index)
        return rows

    def _column(self, key: Key, index: Tensor) -> Tensor:
        column: Tensor = self._storage.get(key)
        return column.index_select(0, index.flatten()).unflatten(0, index.shape)

    def state_dict(self) -> dict[str, Any]:
        """Return how much was added; the rows themselves are left out."""
        return {"frames": self.frames}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.frames = state["frames"]

"""The replay buffer of one team: TorchRL's, filled with segments and sampled in windows."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Iterable
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyMemmapStorage, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers import Sequence

from veca_marl.algos.sac.config import ReplayCfg, Storage
from veca_marl.algos.sac.segments import END, Key, StoredKeys, segment_rows
from veca_marl.algos.sac.windows import Windows
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.storage import StorageNeeded, state_bytes


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
        self._rows_written = 0
        self._buffer: TensorDictReplayBuffer | None = None  # made with the first rows
        # one row more than steps: the observation that follows the last one
        self._unit = Sequence(length=1, bootstrap=steps, done_key=END)

    def __len__(self) -> int:
        """Return the number of rows."""
        return min(self._rows_written, self.cfg.capacity)

    @property
    def ready(self) -> bool:
        """Whether there are enough rows to learn from."""
        return len(self) >= max(self.cfg.warm_up_frames, 1)

    def extend(self, batch: TensorDictBase) -> None:
        """Add a batch ``(worlds, steps)``."""
        self._write(segment_rows(batch, self._keys))
        self.frames += batch.numel()

    def _write(self, rows: TensorDictBase) -> None:
        if self._buffer is None:
            self._buffer = TensorDictReplayBuffer(storage=self._make_storage())
        self._buffer.extend(rows)
        self._rows_written += len(rows)

    def _make_storage(self) -> LazyTensorStorage:
        if self.cfg.storage is Storage.memory:
            return LazyTensorStorage(self.cfg.capacity)
        if self.cfg.folder is not None:
            Path(self.cfg.folder).mkdir(parents=True, exist_ok=True)
        folder = mkdtemp(prefix="veca_marl_replay_", dir=self.cfg.folder)
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        # TorchRL's own removal of the files would replace the handlers of Ctrl-C and SIGTERM
        return LazyMemmapStorage(self.cfg.capacity, scratch_dir=folder, auto_cleanup=False)

    @property
    def _storage(self) -> LazyTensorStorage:
        if self._buffer is None:
            raise RuntimeError("the replay buffer is empty")
        return self._buffer.storage

    def _places(self, ages: Tensor) -> Tensor:
        """Return the places of rows in the ring; age 0 is the oldest row."""
        full = self._rows_written > self.cfg.capacity
        return (ages + self._rows_written * full) % self.cfg.capacity

    def sample(self, windows: int) -> Windows:
        """Return uniformly drawn windows."""
        drawn = self._places(torch.randint(len(self), (windows,)))
        index, info = self._unit.expand(drawn, {}, self._storage)
        index = index.view(windows, -1)
        keys, steps = self._keys, index[:, :-1]
        return Windows(
            first=self._rows((*keys.state, *keys.action), index[:, 0]),
            last=self._rows(keys.state, index[:, -1]),
            reward=self._column((keys.team, "reward"), steps).squeeze(-1),
            terminated=self._column((keys.team, "terminated"), steps).squeeze(-1),
            took_place=info["validity_mask"].view(windows, -1)[:, 1:],
        )

    def _rows(self, keys: Iterable[Key | str], index: Tensor) -> TensorDict:
        rows = TensorDict({}, index.shape)
        for key in keys:
            rows[key] = self._column(key, index)
        return rows

    def _column(self, key: Key | str, index: Tensor) -> Tensor:
        column: Tensor = self._storage.get(key)
        rows: Tensor = column.index_select(0, index.flatten()).unflatten(0, index.shape)
        return rows

    def state_dict(self) -> dict[str, Any]:
        """Return how much was added, and the rows from the oldest on if they are to be kept."""
        rows = None
        if self.cfg.in_checkpoint and len(self):
            rows = self._rows(
                [*self._keys.all, END], self._places(torch.arange(len(self)))
            ).to_dict()
        return {"frames": self.frames, "rows": rows}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.frames = state["frames"]
        self._rows_written, self._buffer = 0, None
        if state["rows"] is not None:
            self._write(TensorDict(state["rows"], [len(state["rows"][END])]))


def storage_needed(spec: TeamSpec, cfg: ReplayCfg) -> StorageNeeded:
    """Return what the replay buffer of a team takes."""
    size = cfg.capacity * state_bytes(spec)
    copies = 2 * size if cfg.in_checkpoint else 0
    settings = "algo.replay.capacity, algo.replay.storage=memmap, algo.replay.in_checkpoint"
    if cfg.storage is Storage.memory:
        return StorageNeeded(size + copies, settings=settings)
    folder = Path(cfg.folder or gettempdir())
    return StorageNeeded(copies, size, folder, "algo.replay.capacity, algo.replay.folder")

"""The replay buffer of one team: TorchRL's, filled with segments and sampled in windows."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Iterable
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyMemmapStorage, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers import Sequence

from veca_marl.algos.sac.config import ReplayCfg, Storage
from veca_marl.algos.sac.replay.scratch import make_scratch_folder
from veca_marl.algos.sac.replay.segments import END, PLACE, Key, StoredKeys, segment_rows
from veca_marl.algos.sac.replay.windows import VALID, Span, Windows
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.storage import StorageNeeded, reserve_disk, reserve_memory, state_bytes

_MEMORY = "algo.replay.capacity, algo.replay.storage=memmap, algo.replay.in_checkpoint"
_DISK = "algo.replay.capacity, algo.replay.folder"


class _ReservedMemory(LazyTensorStorage):
    """TorchRL's storage, which takes all of its memory when it is made."""

    def _init(self, data: TensorDictBase) -> None:
        super()._init(data)
        reserve_memory(list(self._storage.values(True, True)), _MEMORY)


class _ReservedFiles(LazyMemmapStorage):
    """TorchRL's storage, which takes all of its disk space when it is made."""

    def _init(self, data: TensorDictBase) -> None:
        super()._init(data)
        for array in self._storage.values(True, True):
            reserve_disk(Path(array.filename))


class Replay:
    """Stores each observation once and returns windows of consecutive rows.

    Storage and ring are TorchRL's, and so are the windows (`Sequence`). Rows are read by
    `index_select`, which copies images 5 times as fast as the indexing of
    `TensorDictReplayBuffer.sample`, and of a window only the observations that are needed.

    Args:
        keys: What is stored.
        cfg: Size.
        span: Rows of a window.

    Attributes:
        frames: Frames that were ever added.
    """

    # since the buffer was last empty; those that were overwritten count
    _gathered = 0

    def __init__(self, keys: StoredKeys, cfg: ReplayCfg, span: Span) -> None:
        self.cfg, self.frames = cfg, 0
        self._keys, self._span = keys, span
        self._rows_written = 0
        self._buffer: TensorDictReplayBuffer | None = None  # made with the first rows
        self._table: TensorDictBase = TensorDict({}, [0])
        self._starts = torch.zeros(0, dtype=torch.long)  # places of the first rows of parts
        self._unit = Sequence(
            length=span.length, bootstrap=span.steps, burn_in=span.burn_in, done_key=END
        )

    def __len__(self) -> int:
        """Return the number of rows."""
        return min(self._rows_written, self.cfg.capacity)

    @property
    def ready(self) -> bool:
        """Whether there are enough frames to learn from."""
        return self._gathered >= max(self.cfg.warm_up_frames, 1)

    def extend(self, batch: TensorDictBase) -> None:
        """Add a batch ``(worlds, steps)``."""
        self._write(segment_rows(batch, self._keys))
        self.frames += batch.numel()
        self._gathered += batch.numel()

    def _write(self, rows: TensorDictBase) -> None:
        if self._buffer is None:
            self._buffer = TensorDictReplayBuffer(storage=self._make_storage())
        self._buffer.extend(rows)
        self._rows_written += len(rows)
        self._table = self._storage[:]  # views of all rows; to make them takes longer than to read
        self._starts = self._part_starts()

    def _part_starts(self) -> Tensor:
        """Return the places of the rows in which parts begin, from the oldest on."""
        places = self._places(torch.arange(len(self)))
        begins = self._column(PLACE, places) % self._span.length == 0
        return places[begins & ~self._column(END, places)]

    def _make_storage(self) -> LazyTensorStorage:
        if self.cfg.storage is Storage.memory:
            return _ReservedMemory(self.cfg.capacity)
        folder = make_scratch_folder(Path(self.cfg.folder or gettempdir()))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        # TorchRL's own removal of the files would replace the handlers of Ctrl-C and SIGTERM
        return _ReservedFiles(self.cfg.capacity, scratch_dir=str(folder), auto_cleanup=False)

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
        """Return uniformly drawn windows.

        Segments are divided into parts of ``span.length`` steps, the last of which may be shorter.
        The steps of a window that are learnt from are a part, and each part is drawn equally often:
        so is each step. (Of a segment of which the oldest rows have been overwritten, the steps
        before the first complete part are not drawn.)
        """
        keys, span = self._keys, self._span
        index, valid = self._window_rows(windows)
        first, last = (index[:, rows].flatten() for rows in (span.learnt, span.following))
        steps = span.targets(index[:, :-1])
        known = () if keys.memory else keys.observation
        return Windows(
            first=self._rows((*known, *keys.mask, *keys.action), first),
            last=self._rows((*known, *keys.mask), last),
            reward=self._column((keys.team, "reward"), steps).squeeze(-1),
            terminated=self._column((keys.team, "terminated"), steps).squeeze(-1),
            took_place=span.targets(valid[:, 1:]),
            sequences=self._sequences(index, valid) if keys.memory else None,
        )

    def _window_rows(self, windows: int) -> tuple[Tensor, Tensor]:
        """Return places in the ring ``(windows, rows)``, and whether they are in one segment."""
        starts = self._starts[torch.randint(len(self._starts), (windows,))]
        index, info = self._unit.expand(starts, {}, self._storage)
        valid: Tensor = info["validity_mask"]
        return index.view(windows, -1), valid.view(windows, -1)

    def _sequences(self, index: Tensor, valid: Tensor) -> TensorDict:
        """Return all rows of windows; the stored state is read in the first valid one."""
        rows = self._rows(self._keys.state, index)
        begins = valid.clone()
        begins[:, 1:] &= ~valid[:, :-1]
        rows[VALID], rows["is_init"] = valid, begins.unsqueeze(-1)
        return rows

    def _rows(self, keys: Iterable[Key | str], index: Tensor) -> TensorDict:
        rows = TensorDict({}, index.shape)
        for key in keys:
            rows[key] = self._column(key, index)
        return rows

    def _column(self, key: Key | str, index: Tensor) -> Tensor:
        column: Tensor = self._table[key]
        rows: Tensor = column.index_select(0, index.flatten()).unflatten(0, index.shape)
        return rows

    def state_dict(self) -> dict[str, Any]:
        """Return how much was added, and the rows from the oldest on if they are to be kept."""
        rows = None
        if self.cfg.in_checkpoint and len(self):
            rows = self._rows(self._keys.all, self._places(torch.arange(len(self)))).to_dict()
        gathered = 0 if rows is None else self._gathered
        return {"frames": self.frames, "gathered": gathered, "rows": rows}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.frames = state["frames"]
        self._rows_written, self._buffer, self._gathered = 0, None, 0
        if state["rows"] is not None:
            self._write(TensorDict(state["rows"], [len(state["rows"][END])]))
            # checkpoints before version 0.3 do not have it
            self._gathered = state.get("gathered", self._rows_written)


def storage_needed(spec: TeamSpec, cfg: ReplayCfg, memory: int = 0) -> StorageNeeded:
    """Return what the replay buffer of a team takes.

    Args:
        spec: Its arrays.
        cfg: Size of the buffer.
        memory: Length of all hidden states of the team.
    """
    size = cfg.capacity * (state_bytes(spec) + 4 * memory)
    copies = 2 * size if cfg.in_checkpoint else 0
    if cfg.storage is Storage.memory:
        return StorageNeeded(size + copies, settings=_MEMORY)
    folder = Path(cfg.folder or gettempdir())
    return StorageNeeded(copies, size, folder, _DISK)

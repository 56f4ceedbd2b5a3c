"""The replay buffer of one team: stored segments, sampled windows, memory-mapped files.

A segment holds consecutive steps of one world and, as its last row, the observation that follows
them: the true last observation of an episode that was truncated, or the first one that the next
batch begins with. Where an episode or a batch ends, its segment ends. Rows of different worlds,
episodes, batches and stages are therefore never connected.
"""

from __future__ import annotations

import os
import shutil
import socket
import weakref
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyMemmapStorage, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers import Sequence

from veca_marl.algos.mapped_files import expect_scattered_reads
from veca_marl.algos.sac.config import ReplayCfg, Storage
from veca_marl.algos.specs import TeamSpec, action_key
from veca_marl.algos.storage import StorageNeeded, reserve_disk, reserve_memory, state_bytes

END = "end"  # True for the last row of a segment, which has no action
PLACE = "place"  # number of the row in its segment, from 0

Key = tuple[str, ...]


@dataclass(frozen=True)
class StoredKeys:
    """What is stored of one team, beside its reward and its flag ``terminated``.

    Attributes:
        team: Name of the team.
        observation: Observations.
        mask: The mask, where agents can be eliminated.
        memory: Hidden states.
        action: Parts of the action; zeros in the last row of a segment.
    """

    team: str
    observation: tuple[Key, ...]
    mask: tuple[Key, ...]
    memory: tuple[Key, ...]
    action: tuple[Key, ...]

    @property
    def state(self) -> tuple[Key, ...]:
        """What a row has before its action."""
        return (*self.observation, *self.mask, *self.memory)

    @property
    def all(self) -> tuple[Key | str, ...]:
        """Everything that is stored."""
        outcome = ((self.team, "reward"), (self.team, "terminated"))
        return (*self.state, *self.action, *outcome, END, PLACE)

    @classmethod
    def of(cls, team: str, spec: TeamSpec, memory: tuple[Key, ...] = ()) -> StoredKeys:
        """Return the keys of a team with these arrays and these hidden states."""
        observations = tuple((team, "observation", name) for name in spec.observations)
        mask: tuple[Key, ...] = ((team, "mask"),) if spec.masked else ()
        actions = tuple(action_key(team, part) for part in spec.actions)
        return cls(team, observations, mask, memory, actions)


def segment_rows(batch: TensorDictBase, keys: StoredKeys) -> TensorDict:
    """Return the rows ``(n,)`` of all segments of a batch, world by world.

    Args:
        batch: Experience ``(worlds, steps)``.
        keys: What is stored.

    Returns:
        The keys given, ``(team, "reward")`` and ``(team, "terminated")`` of the step that begins
        in the row, `END` and `PLACE`.
    """
    cut = batch["next", "done"].squeeze(-1).clone()
    cut[:, -1] = True
    cut = cut.flatten()
    steps = _steps(batch, keys).flatten()
    finals = _finals(batch["next"].select(*keys.state).flatten()[cut], steps)
    places = torch.arange(len(cut)) + cut.cumsum(0) - cut.long()
    rows = steps.new_empty(len(steps) + len(finals))
    rows[places] = steps
    rows[places[cut] + 1] = finals
    rows[PLACE] = _places(rows[END])
    return rows


def _places(end: Tensor) -> Tensor:
    """Return the number of each row in its segment, counted from 0."""
    rows = torch.arange(len(end))
    first = torch.cat([torch.ones(1, dtype=torch.bool), end[:-1]])
    return rows - (rows * first).cummax(0).values


def _steps(batch: TensorDictBase, keys: StoredKeys) -> TensorDictBase:
    steps = batch.select(*keys.state, *keys.action).detach()
    for name in ("reward", "terminated"):
        steps[keys.team, name] = batch["next", keys.team, name]
    steps[END] = torch.zeros(batch.shape, dtype=torch.bool)
    return steps


def _finals(states: TensorDictBase, steps: TensorDictBase) -> TensorDictBase:
    """Return rows with `states` and zeros for everything else."""
    finals = steps[: len(states)].apply(torch.zeros_like)
    finals.update(states)
    finals[END] = torch.ones(len(states), dtype=torch.bool)
    return finals


VALID = "valid"  # False for rows of a window before the start or after the end of its segment


@dataclass(frozen=True)
class Span:
    """Consecutive rows of a window: ``burn_in``, then ``length``, then ``steps``.

    Attributes:
        burn_in: Rows from which only the hidden state is computed.
        length: Steps that are learnt from.
        steps: Rewards in the target of each of them.
    """

    burn_in: int
    length: int
    steps: int

    @property
    def learnt(self) -> slice:
        """Rows of the steps that are learnt from."""
        return slice(self.burn_in, self.burn_in + self.length)

    @property
    def following(self) -> slice:
        """Rows of the observations after the rewards of each of them."""
        return slice(self.burn_in + self.steps, self.burn_in + self.steps + self.length)

    def targets(self, rows: Tensor) -> Tensor:
        """Return the rewards of each target, ``(windows * length, steps, ...)``.

        Args:
            rows: Something of each step of windows, ``(windows, rows - 1, ...)``.
        """
        return rows[:, self.burn_in :].unfold(1, self.steps, 1).flatten(0, 1)


@dataclass(frozen=True)
class Windows:
    """What was drawn from a replay buffer for B targets.

    Attributes:
        first: Rows ``(B,)``: observation, mask and action of the first step of a target.
        last: Rows ``(B,)``: observation and mask after its last step.
        reward: ``(B, steps, agents)``.
        terminated: ``(B, steps, agents)``.
        took_place: ``(B, steps)``, False for steps after the end of an episode or a batch.
        sequences: For networks with hidden state: all rows of the windows ``(windows, rows)`` with
            observation, mask, hidden state, ``is_init`` and `VALID`; `first` and `last` have no
            observations then. B is the number of windows times ``span.length``.
    """

    first: TensorDictBase
    last: TensorDictBase
    reward: Tensor
    terminated: Tensor
    took_place: Tensor
    sequences: TensorDictBase | None = None

    @property
    def observed(self) -> tuple[TensorDictBase, ...]:
        """Rows with observations, each of batch size ``(windows, ...)``."""
        return (self.first, self.last) if self.sequences is None else (self.sequences,)


@dataclass(frozen=True)
class Transitions:
    """What one update learns from.

    Attributes:
        first: Rows ``(B,)``, see `Windows`.
        last: Rows ``(B,)``, see `Windows`.
        returns: Discounted sum of the rewards of the window, ``(B, agents)``.
        discount: Factor of the value of `last`, ``(B, agents)``: 0 if the agent's episode was
            terminated in the window.
        counted: ``(B, agents)``, True for entries to learn from: agents that are present, in
            windows with at least one step.
        sequences: See `Windows`.
    """

    first: TensorDictBase
    last: TensorDictBase
    returns: Tensor
    discount: Tensor
    counted: Tensor
    sequences: TensorDictBase | None = None

    def to(self, device: torch.device) -> Transitions:
        """Return the same on `device`."""
        present = {name: array for name, array in vars(self).items() if array is not None}
        return Transitions(**{name: array.to(device) for name, array in present.items()})


def transitions(windows: Windows, team: str, gamma: float) -> Transitions:
    """Return what is learnt from `windows`.

    Args:
        windows: The windows.
        team: Name of the team.
        gamma: Discount of one step.
    """
    took_place = windows.took_place.unsqueeze(-1)
    factor = torch.where(took_place, gamma, 1.0) * ~(windows.terminated & took_place)
    before = torch.cat([torch.ones_like(factor[:, :1]), factor[:, :-1]], 1).cumprod(1)
    present = took_place[:, 0].expand_as(windows.reward[:, 0])
    mask = windows.first[team].get("mask", None)
    return Transitions(
        first=windows.first,
        last=windows.last,
        returns=(before * windows.reward * took_place).sum(1),
        discount=factor.prod(1),
        counted=present if mask is None else present & mask,
        sequences=windows.sequences,
    )


_PREFIX = "veca_marl_replay_"


def make_scratch_folder(parent: Path) -> Path:
    """Create a folder for the files of one replay buffer.

    Folders of processes of this machine that have ended without removing theirs (killed, out of
    memory) are removed before.

    Args:
        parent: Where it is created; created if absent.
    """
    parent.mkdir(parents=True, exist_ok=True)
    owner = f"{_PREFIX}{socket.gethostname()}_"
    for folder in parent.glob(f"{owner}*"):
        process = folder.name.removeprefix(owner).partition("_")[0]
        if process.isdigit() and not _is_running(int(process)):
            shutil.rmtree(folder, ignore_errors=True)
    return Path(mkdtemp(prefix=f"{owner}{os.getpid()}_", dir=parent))


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # of another user
        return True
    return True


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
            expect_scattered_reads(array)


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

    def seed(self, rows: TensorDictBase) -> None:
        """Add segments that were not collected; they count for the warm-up.

        Args:
            rows: See `segment_rows`, without `PLACE`.
        """
        rows[PLACE] = _places(rows[END])
        self._write(rows)
        self._gathered += int((~rows[END]).sum())

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

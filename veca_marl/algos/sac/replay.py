"""The replay buffer of one team: TorchRL's, filled with segments and sampled in windows."""

from __future__ import annotations

from typing import Any

from tensordict import TensorDictBase
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers import Sequence

from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.sac.segments import END, StoredKeys, segment_rows
from veca_marl.algos.specs import TeamSpec


class Replay:
    """Stores each observation once and returns windows of consecutive rows.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: Size.
        steps: Steps of a window, which has one row more.
        windows: Windows in a sample.

    Attributes:
        frames: Frames that were ever added.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: ReplayCfg, steps: int, windows: int) -> None:
        self.cfg, self.frames = cfg, 0
        self._keys, self._windows = StoredKeys.of(team, spec), windows
        self._buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(cfg.capacity),
            sample_unit=Sequence(length=1, bootstrap=steps, done_key=END),
            batch_size=windows,
        )

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

    def sample(self) -> TensorDictBase:
        """Return uniformly drawn windows ``(windows, steps + 1)``, see `windows.transitions`."""
        rows: TensorDictBase = self._buffer.sample()
        return rows.reshape(self._windows, -1)

    def state_dict(self) -> dict[str, Any]:
        """Return how much was added; the rows themselves are left out."""
        return {"frames": self.frames}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.frames = state["frames"]

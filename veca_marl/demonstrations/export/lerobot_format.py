"""Demonstrations of one agent as a data set of LeRobot, version 3.0 of its format.

Files are written by their published layout, without the package ``lerobot``, which needs several
gigabytes of others::

    meta/info.json                                      features, counts, paths
    meta/stats.json                                     statistics of each feature
    meta/tasks.parquet                                  index to text of tasks
    meta/episodes/chunk-000/file-000.parquet            where each episode is
    data/chunk-000/file-000.parquet                     arrays, one row for each step
    videos/observation.images.left/chunk-000/file-000.mp4

An episode has a file of its own for its arrays and for each camera, up to a thousand in a chunk.
Images of both eyes are two cameras; other senses (touch, spectra, samples of the ears) are array
features ``observation.SENSE``. The parts of an action are joined to one vector ``action``, choices
as their numbers.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.algos.demonstration_files import DemonstrationsError
from veca_marl.algos.files import write_atomically, write_errors
from veca_marl.algos.specs import PLAIN, ArrayLayout
from veca_marl.demonstrations.export.agent import AgentEpisode, Arrays, DemonstratedAgent
from veca_marl.runs.video import VideoFile

CODEBASE_VERSION = "v3.0"
CHUNK = 1000  # files in a chunk
_PATHS = {
    "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
}
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_EYES = ("left", "right")
_COUNTERS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


def export_lerobot(agent: DemonstratedAgent, folder: Path) -> None:
    """Write a data set of LeRobot.

    Args:
        agent: Whose data are written.
        folder: Folder of the data set, which must not exist.

    Raises:
        ModuleNotFoundError: Without the extra ``[lerobot]``.
        DemonstrationsError: If the folder exists, or images have an odd width or height.
        WriteError: If a file cannot be written.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise ModuleNotFoundError(
            "format=lerobot needs pyarrow: pip install 'veca_marl[lerobot]'", name="pyarrow"
        ) from error
    if folder.exists():
        raise DemonstrationsError(f"{folder} exists; choose another folder")
    for sense, layout in agent.observations.items():
        if layout.is_image and any(length % 2 for length in layout.shape[-2:]):
            height, width = layout.shape[-2:]
            raise DemonstrationsError(
                f"{sense} has {width} x {height} pixels: videos need even numbers; format=minari "
                "takes all"
            )
    with write_errors(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".") as draft:
            complete = Path(draft, folder.name)
            _Export(agent, complete).write()
            complete.rename(folder)


@dataclass
class RunningStatistics:
    """Smallest and largest value, mean and standard deviation of rows that are added in parts.

    Attributes:
        count: Rows.
    """

    count: int = 0
    _sums: list[Any] = field(default_factory=list)

    def add(self, rows: NDArray[Any]) -> None:
        """Add rows ``(n, ...)``."""
        x = np.asarray(rows, np.float64)
        new = [x.min(0), x.max(0), x.sum(0), (x * x).sum(0)]
        if self.count:
            old = self._sums
            new = [np.minimum(old[0], new[0]), np.maximum(old[1], new[1])] + [
                old[i] + new[i] for i in (2, 3)
            ]
        self._sums, self.count = new, self.count + len(x)

    def to_dict(self, rows: int) -> dict[str, Any]:
        """Return the numbers as the format has them.

        Args:
            rows: The ``count`` that is stated: frames, also where each has many pixels.
        """
        low, high, total, squares = self._sums
        mean = total / self.count
        deviation = np.sqrt(np.maximum(squares / self.count - mean * mean, 0.0))
        found = {"min": low, "max": high, "mean": mean, "std": deviation}
        return {name: np.atleast_1d(v).tolist() for name, v in found.items()} | {"count": [rows]}


class _Export:
    """Writes one data set."""

    def __init__(self, agent: DemonstratedAgent, folder: Path) -> None:
        self._agent, self._folder = agent, folder
        self._rate = agent.demonstrations.card.control_rate_hz
        self._images = {s: a for s, a in agent.observations.items() if a.is_image}
        self._statistics: dict[str, RunningStatistics] = {}

    def write(self) -> None:
        """Write all files; the card of the data set comes last."""
        rows, frames = [], 0
        has_goal = False
        for number in range(len(self._agent.demonstrations)):
            episode = self._agent.episode(number)
            has_goal = episode.solved is not None
            place = {"chunk_index": number // CHUNK, "file_index": number % CHUNK}
            columns = self._columns(episode, number, frames)
            _write_table(self._folder / _PATHS["data_path"].format(**place), columns)
            rows.append(self._episode_row(number, episode.steps, frames, place))
            self._write_videos(episode, place)
            self._add_statistics(columns)
            frames += episode.steps
        self._write_meta(rows, frames, has_goal)

    def _columns(self, episode: AgentEpisode, number: int, frames: int) -> Arrays:
        """Return the arrays of an episode by feature."""
        steps = episode.steps
        numbers = np.arange(steps)
        columns: Arrays = {
            f"observation.{sense}": array[:-1]
            for sense, array in episode.observations.items()
            if sense not in self._images
        }
        columns["action"] = _joined(episode.actions)
        columns["next.reward"] = episode.rewards.astype(np.float32)
        columns["next.done"] = episode.terminated | episode.truncated
        if episode.solved is not None:
            columns["next.success"] = episode.solved
        return columns | {
            "timestamp": (numbers / self._rate).astype(np.float32),
            "frame_index": numbers,
            "episode_index": np.full(steps, number),
            "index": numbers + frames,
            "task_index": np.zeros(steps, np.int64),
        }

    def _episode_row(
        self, number: int, steps: int, frames: int, place: Mapping[str, int]
    ) -> dict[str, Any]:
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [self._task],
            "length": steps,
            "dataset_from_index": frames,
            "dataset_to_index": frames + steps,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        row |= {f"data/{name}": value for name, value in place.items()}
        for key in self._cameras:
            row |= {f"videos/{key}/{name}": value for name, value in place.items()}
            row[f"videos/{key}/from_timestamp"] = 0.0
            row[f"videos/{key}/to_timestamp"] = steps / self._rate
        return row

    @property
    def _task(self) -> str:
        return self._agent.demonstrations.card.task

    @property
    def _cameras(self) -> dict[str, tuple[str, int]]:
        """The name of each camera, and the sense and the index of its images."""
        return {
            f"observation.images.{name}": (sense, index)
            for sense, layout in self._images.items()
            for index, name in enumerate(_camera_names(sense, layout, len(self._images)))
        }

    def _write_videos(self, episode: AgentEpisode, place: Mapping[str, int]) -> None:
        for key, (sense, index) in self._cameras.items():
            images = episode.observations[sense][:-1]
            pictures = images.reshape(len(images), -1, *images.shape[-3:])[:, index]
            pictures = np.moveaxis(pictures, 1, -1)
            path = self._folder / _PATHS["video_path"].format(video_key=key, **place)
            with VideoFile(path, pictures.shape[1:3], self._rate, None) as video:
                for picture in pictures:
                    video.add_picture(picture)
            pixels = pictures.reshape(-1, 3, 1, 1) / 255.0
            self._statistics.setdefault(key, RunningStatistics()).add(pixels)

    def _add_statistics(self, columns: Arrays) -> None:
        for name, array in columns.items():
            self._statistics.setdefault(name, RunningStatistics()).add(array)

    def _write_meta(self, rows: list[dict[str, Any]], frames: int, has_goal: bool) -> None:
        card = self._agent.demonstrations.card
        _write_rows(self._folder / _EPISODES, rows)
        _write_tasks(self._folder / "meta/tasks.parquet", [self._task])
        statistics = {name: one.to_dict(frames) for name, one in self._statistics.items()}
        write_atomically(self._folder / "meta/stats.json", json.dumps(statistics) + "\n")
        info = {
            "codebase_version": CODEBASE_VERSION,
            "robot_type": str(card.teams[self._agent.team].body.get("kind")),
            "total_episodes": len(rows),
            "total_frames": frames,
            "total_tasks": 1,
            "chunks_size": CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._rate,
            "splits": {"train": f"0:{len(rows)}"},
            **_PATHS,
            "features": self._features(has_goal),
        }
        if not self._images:
            info["video_path"] = None
        write_atomically(self._folder / "meta/info.json", json.dumps(info, indent=4) + "\n")

    def _features(self, has_goal: bool) -> dict[str, Any]:
        features = {
            key: {
                "dtype": "video",
                "shape": [*self._images[sense].shape[-2:], 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": self._images[sense].shape[-2],
                    "video.width": self._images[sense].shape[-1],
                    "video.channels": 3,
                    "video.fps": self._rate,
                    "video.pix_fmt": "yuv420p",
                    "video.is_depth_map": False,
                    "has_audio": False,
                },
            }
            for key, (sense, _) in self._cameras.items()
        }
        for sense, layout in self._agent.observations.items():
            if sense not in self._images:
                features[f"observation.{sense}"] = _feature(layout.dtype, layout.shape or (1,))
        names = _action_names(self._agent)
        features["action"] = _feature("float32", (len(names),), names)
        features["next.reward"] = _feature("float32", (1,))
        features["next.done"] = _feature("bool", (1,))
        if has_goal:
            features["next.success"] = _feature("bool", (1,))
        return features | {name: _feature(dtype, (1,)) for name, dtype in _COUNTERS.items()}


def _feature(dtype: str, shape: tuple[int, ...], names: list[str] | None = None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": list(shape), "names": names}


def _camera_names(sense: str, layout: ArrayLayout, senses: int) -> list[str]:
    """Return the names of the images of a sense: both eyes of a binocular one."""
    count = int(np.prod(layout.shape[:-3], dtype=np.int64))
    names = list(_EYES) if count == len(_EYES) else [str(i) for i in range(count)]
    return names if senses == 1 else [f"{sense}_{name}" for name in names]


def _joined(actions: Arrays) -> NDArray[np.float32]:
    return np.concatenate(
        [array.reshape(len(array), -1).astype(np.float32) for array in actions.values()], axis=1
    )


def _action_names(agent: DemonstratedAgent) -> list[str]:
    """Return a name for each number of an action."""
    names = []
    for part, layout in agent.actions.items():
        name = "action" if part == PLAIN else part
        names += [name] if layout.discrete else [f"{name}_{i}" for i in range(layout.size)]
    return names


def _write_table(path: Path, columns: Arrays) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table({name: _arrow(array) for name, array in columns.items()})
    pq.write_table(table, path, compression="snappy")


def _arrow(array: NDArray[Any]) -> Any:
    """Return rows as Arrow has them: numbers, vectors of a fixed length, or nested lists."""
    import pyarrow as pa

    rows = np.ascontiguousarray(array)
    if rows.ndim == 1 or rows.shape[1:] == (1,):
        return pa.array(rows.reshape(-1))
    values = pa.array(rows.reshape(-1))
    if rows.ndim == 2:
        return pa.FixedSizeListArray.from_arrays(values, rows.shape[1])
    for length in reversed(rows.shape[1:]):
        offsets = np.arange(0, len(values) + 1, length, dtype=np.int32)
        values = pa.ListArray.from_arrays(pa.array(offsets), values)
    return values


def _write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), path, compression="snappy")


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """Write the texts of tasks as pandas writes a table of which they are the index."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def column(name: str, kind: str, numpy_type: str) -> dict[str, Any]:
        return {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": numpy_type,
            "metadata": None,
        }

    described = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
    }
    table = pa.table({"task_index": list(range(len(tasks))), "task": tasks})
    table = table.replace_schema_metadata({"pandas": json.dumps(described)})
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)

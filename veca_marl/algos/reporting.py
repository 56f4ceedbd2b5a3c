"""Where the numbers of a run go: CSV files, a list, or a logger of TorchRL."""

from __future__ import annotations

import csv
import logging
import math
import os
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from torchrl.record.loggers import Logger, MLFlowLogger, TensorboardLogger, WandbLogger

from veca_marl.algos.files import WriteError, open_to_append, write_atomically, write_errors
from veca_marl.stored_files import cells_in, read_cells, read_table_text

_LOG = logging.getLogger(__name__)

Row = Mapping[str, float | int | str]


class Reporter(ABC):
    """Receives rows of numbers."""

    @abstractmethod
    def write(self, kind: str, frames: int, row: Row) -> None:
        """Record `row`, measured after `frames` training frames.

        Args:
            kind: ``metrics`` for a row per batch, ``evaluations`` for a row per evaluated team.
            frames: See above.
            row: Name to value; words tell rows of one kind and one number of frames apart.
        """

    def write_values(  # noqa: B027  optional
        self, frames: int, values: Mapping[str, NDArray[Any]]
    ) -> None:
        """Record distributions after a stage, if there is a place for them.

        Args:
            frames: As for `write`.
            values: Name to all values, in an array of any shape.
        """

    def write_video(self, frames: int, gif: bytes) -> None:  # noqa: B027  optional
        """Record a video, an animated GIF, if there is a place for it."""

    @abstractmethod
    def sync(self) -> None:
        """Let the rows so far survive a power cut: a checkpoint that follows them is written."""

    @abstractmethod
    def close(self) -> None:
        """Write what is pending."""


class MemoryReporter(Reporter):
    """Keeps the rows.

    Attributes:
        rows: Kind to rows, each with the column ``frames``.
    """

    def __init__(self) -> None:
        self.rows: dict[str, list[dict[str, Any]]] = defaultdict(list)

    def write(self, kind: str, frames: int, row: Row) -> None:
        """See `Reporter`."""
        self.rows[kind].append({"frames": frames, **row})

    def sync(self) -> None:
        """See `Reporter`; nothing is stored."""

    def close(self) -> None:
        """See `Reporter`; nothing is pending."""


class CsvReporter(Reporter):
    """One tidy file per kind of row: ``metrics.csv``, ``evaluations.csv``.

    TorchRL's `CSVLogger` writes a file for each number; here one table holds a run, and a resumed
    run drops the rows that it writes again. Numbers that the first row does not have become columns
    when they are first written. A table that was deleted or cut off during the run is written again
    with all of its rows, which are kept in memory, and a warning is logged.

    Args:
        folder: Folder of the files.
        resumed_frames: Rows after so many frames are dropped; all of them at 0.

    Raises:
        WriteError: If a file cannot be written; `write` raises it too.
    """

    KINDS = ("metrics", "evaluations")

    def __init__(self, folder: Path, resumed_frames: int = 0) -> None:
        self._folder = folder
        paths = {kind: folder / f"{kind}.csv" for kind in self.KINDS}
        self._rows = {kind: _kept_rows(paths[kind], resumed_frames) for kind in self.KINDS}
        self._columns = {kind: _columns(paths[kind]) for kind in self.KINDS}
        self._bytes = {kind: _bytes(paths[kind]) for kind in self.KINDS}

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Append `row` to ``<kind>.csv``; not-a-number is left blank."""
        self._write_lost_rows(kind)
        path = self._folder / f"{kind}.csv"
        full = {"frames": frames, **row}
        columns = self._columns[kind] if path.exists() else []
        added = [name for name in full if name not in columns]
        if columns and added:
            _add_columns(path, added)
        cells = {name: _cell(value) for name, value in full.items()}
        row_text = _table([*columns, *added], [cells], header=not columns)
        with write_errors(path), open_to_append(path) as file:
            file.write(row_text)
            file.flush()
            self._bytes[kind] = os.fstat(file.fileno()).st_size
        self._columns[kind] = [*columns, *added]
        self._rows[kind].append(cells)

    def _write_lost_rows(self, kind: str) -> None:
        """Write a table again that is shorter than it was after the last row."""
        path = self._folder / f"{kind}.csv"
        # a missing folder and a link are errors of the next row
        if _bytes(path) >= self._bytes[kind] or path.is_symlink() or not self._folder.is_dir():
            return
        text = _table(self._columns[kind], self._rows[kind], header=True)
        write_atomically(path, text)
        self._bytes[kind] = len(text.encode())
        _LOG.warning(
            "%s was deleted or cut off during the run: its %d rows are written again",
            path,
            len(self._rows[kind]),
        )

    def sync(self) -> None:
        """See `Reporter`."""
        for kind in self.KINDS:
            self._write_lost_rows(kind)
            path = self._folder / f"{kind}.csv"
            if path.exists():
                with write_errors(path), open_to_append(path) as file:
                    os.fsync(file.fileno())

    def close(self) -> None:
        """See `Reporter`; each row is written at once, so that only lost ones are pending."""
        for kind in self.KINDS:
            self._write_lost_rows(kind)


class LoggerReporter(Reporter):
    """One curve per number, named ``kind/name``, in a logger of TorchRL.

    Args:
        logger: The logger.
        path: Where it writes.

    Raises:
        WriteError: If it cannot write there; `write` and `close` raise it.
    """

    def __init__(self, logger: Logger, path: Path) -> None:
        self._logger, self._path = logger, path

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Add a point to each curve; a row's words become part of the names of its curves."""
        words = [value for value in row.values() if isinstance(value, str)]
        for name, value in row.items():
            if not isinstance(value, str) and math.isfinite(value):
                curve = "/".join([kind, *words, name])
                with write_errors(self._path):
                    self._logger.log_scalar(curve, float(value), step=frames)

    def sync(self) -> None:
        """See `Reporter`; the logger decides when it writes."""

    def close(self) -> None:
        """Write pending points."""
        with write_errors(self._path):
            self._logger.close()


class TensorboardReporter(LoggerReporter):
    """Curves, histograms and videos in TensorBoard.

    TorchRL's logger takes videos as tensors, for which TensorBoard needs `moviepy`; TensorBoard
    itself shows an animated GIF as it is.
    """

    _logger: TensorboardLogger

    def write_values(self, frames: int, values: Mapping[str, NDArray[Any]]) -> None:
        """See `Reporter`: a histogram each."""
        with write_errors(self._path):
            for name, array in values.items():
                self._logger.log_histogram(name, array, step=frames, bins="auto")

    def write_video(self, frames: int, gif: bytes) -> None:
        """See `Reporter`."""
        from tensorboard.compat.proto.summary_pb2 import Summary

        image = Summary.Image(encoded_image_string=gif, colorspace=3)
        summary = Summary(value=[Summary.Value(tag="video", image=image)])
        with write_errors(self._path):
            self._logger.experiment.file_writer.add_summary(summary, frames)


def _bytes(path: Path) -> int:
    """Return the size of a file, 0 if there is none."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _columns(path: Path) -> list[str]:
    """Return the names in the first line of a table; nothing if there is no such file."""
    if not path.exists():
        return []
    with _table_errors(path):
        names, _ = read_cells(path)
        return names


def _add_columns(path: Path, names: Sequence[str]) -> None:
    """Add columns to a table, which are blank in its rows."""
    with _table_errors(path):
        before, rows = read_cells(path)
        text = _table([*before, *names], rows, header=True)
    write_atomically(path, text)


def _cell(value: float | int | str) -> str | int:
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return ""
    return f"{value:.0f}" if value.is_integer() else f"{value:.6g}"  # numbers of frames in full


def _table(columns: Iterable[str], rows: Iterable[Mapping[str, Any]], header: bool) -> str:
    text = StringIO(newline="")
    writer = csv.DictWriter(text, list(columns))
    if header:
        writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


@contextmanager
def _table_errors(path: Path) -> Iterator[None]:
    """Raise `WriteError` where a stored table cannot be read: it is to be continued."""
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        reason = str(error) if isinstance(error, ValueError) else repr(error)
        named = reason if str(path) in reason else f"{path} is damaged ({reason})"
        raise WriteError(f"{named}: move it away to continue") from error


def _kept_rows(path: Path, frames: int) -> list[dict[str, Any]]:
    """Drop the rows after `frames`, and one that was cut off while it was written; return the rest.

    The file is removed if none is left: the next row writes the header.
    """
    if not path.exists():
        return []
    with _table_errors(path):
        whole, end, _ = read_table_text(path).rpartition("\n")
        if frames and not end:
            raise ValueError("no line is complete")
        names, rows = cells_in(path, whole)
        kept = [row for row in rows if frames and int(row["frames"]) <= frames]
        if any(None in row or None in row.values() for row in kept):
            raise ValueError("a row has another number of cells than the head")
    if kept:
        write_atomically(path, _table(names, kept, header=True))
    else:
        path.unlink()
    return kept


_TAG = "veca_marl.run"  # of a run in MLflow: the identifier by which it is continued


class LoggerKind(Enum):
    """A place for the numbers of a run.

    Attributes:
        csv: ``metrics.csv`` and ``evaluations.csv`` in the folder of the run.
        tensorboard: Event files in its folder ``tensorboard``.
        wandb: Weights & Biases, project ``veca_marl``; ``WANDB_MODE=offline`` stays local.
        mlflow: MLflow; ``MLFLOW_TRACKING_URI`` or ``mlflow.db`` there.
    """

    csv = "csv"
    tensorboard = "tensorboard"
    wandb = "wandb"
    mlflow = "mlflow"


class _Tensorboard(TensorboardLogger):
    """TorchRL's logger, with the points after a checkpoint hidden when a run resumes from it."""

    def __init__(self, folder: Path, identifier: str, resumed_frames: int) -> None:
        self._purge_step = resumed_frames + 1 if resumed_frames else None
        super().__init__(exp_name="tensorboard", log_dir=str(folder))

    def _create_experiment(self) -> Any:
        from torch.utils.tensorboard import SummaryWriter

        path = str(Path(self.log_dir) / self.exp_name)
        return SummaryWriter(path, purge_step=self._purge_step)


def _wandb(folder: Path, identifier: str, resumed_frames: int) -> Logger:
    return WandbLogger(
        exp_name=folder.name, save_dir=str(folder), project="veca_marl", id=identifier
    )


class _MLflow(MLFlowLogger):
    """TorchRL's logger, with one run in MLflow for a run and what resumes it.

    TorchRL starts a new one each time, and leaves it open when it is closed, so that a second one
    could not start. MLflow's default is a folder of files, which its newer versions refuse: here
    it is SQLite.
    """

    def __init__(self, folder: Path, identifier: str, resumed_frames: int) -> None:
        import mlflow

        self._name, self._identifier = folder.name, identifier
        self._given: Any = mlflow.get_tracking_uri() if mlflow.is_tracking_uri_set() else None
        in_folder = f"sqlite:///{folder.resolve() / 'mlflow.db'}"
        super().__init__("veca_marl", self._given or in_folder)

    def _create_experiment(self) -> Any:
        import mlflow

        self.id = mlflow.set_experiment(self.exp_name).experiment_id
        begun = mlflow.search_runs(
            experiment_ids=[self.id],
            filter_string=f"tags.`{_TAG}` = '{self._identifier}'",
            output_format="list",
        )
        if begun:
            return mlflow.start_run(run_id=begun[0].info.run_id)
        return mlflow.start_run(run_name=self._name, tags={_TAG: self._identifier})

    def shutdown(self, timeout: float | None = None) -> None:
        """End the run; the next one of this process chooses its own place."""
        import mlflow

        super().shutdown(timeout)
        mlflow.end_run()
        mlflow.set_tracking_uri(self._given)


_MAKERS: dict[LoggerKind, Callable[[Path, str, int], Logger]] = {
    LoggerKind.tensorboard: _Tensorboard,
    LoggerKind.wandb: _wandb,
    LoggerKind.mlflow: _MLflow,
}


def check_installed(kind: LoggerKind) -> None:
    """Check that the package behind a logger can be imported.

    Raises:
        ValueError: If it is not installed.
    """
    if kind is not LoggerKind.csv and find_spec(kind.value) is None:
        raise ValueError(
            f"log.logger: {kind.value} is not installed: pip install 'veca_marl[{kind.value}]'"
        )


def make_reporter(
    kind: LoggerKind, folder: Path, identifier: str, resumed_frames: int = 0
) -> Reporter:
    """Return what writes the numbers of a run.

    Args:
        kind: Where to.
        folder: Folder of the run.
        identifier: A name that no other run has, by which a resumed one continues its curves.
        resumed_frames: Frames of the checkpoint from which the run continues, or 0.

    Raises:
        ValueError: If the package behind it is not installed.
        WriteError: If it cannot write into the folder.
    """
    check_installed(kind)
    if kind is LoggerKind.csv:
        return CsvReporter(folder, resumed_frames)
    with write_errors(folder):
        logger = _MAKERS[kind](folder, identifier, resumed_frames)
    in_tensorboard = kind is LoggerKind.tensorboard
    return (TensorboardReporter if in_tensorboard else LoggerReporter)(logger, folder)

"""The loggers that ``log.logger`` names."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from torchrl.record.loggers import Logger, MLFlowLogger, TensorboardLogger, WandbLogger

from veca_marl.algos.files import write_errors
from veca_marl.algos.reporting.reporters import CsvReporter, LoggerReporter, Reporter

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
    return LoggerReporter(logger, folder)

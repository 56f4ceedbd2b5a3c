"""A whole training run: from a configuration to its numbers and its policy."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torchrl import timeit

from veca_marl.algos.collection.experience import CollectCfg, Engine
from veca_marl.algos.reporting import MemoryReporter, Reporter, Row
from veca_marl.algos.training.loop import Trainer
from veca_marl.config import Config
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.supervision import WorkerError
from veca_marl.runs.assembly import make_reporters, make_trainer
from veca_marl.runs.continuation import RunProgress
from veca_marl.runs.cores import contention_warning, idle_cores_hint, load
from veca_marl.runs.run_folder import RunFolder
from veca_marl.runs.video import animated_gif, record_episode

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainingResult:
    """What a training run leaves behind.

    Attributes:
        metrics: A row for each batch: name to number, as in ``metrics.csv``.
        evaluations: A row for each evaluated team, as in ``evaluations.csv``.
        comparison: A line for each team, which compares it with random actions.
        policy: Writes the actions of all teams into a TensorDict of the environment.
        timing: A table of where the time went.
        folder: Folder of the run; None if nothing was stored.
    """

    metrics: list[dict[str, Any]]
    evaluations: list[dict[str, Any]]
    comparison: list[str]
    policy: TensorDictModuleBase
    timing: str
    folder: Path | None


class ProgressReporter(Reporter):
    """Writes ``progress.json`` with each checkpoint.

    Args:
        folder: Folder of the run.
        frames: Frames after which the run begins or continues.
    """

    def __init__(self, folder: RunFolder, frames: int) -> None:
        self._folder, self._frames = folder, frames

    def write(self, kind: str, frames: int, row: Row) -> None:
        """See `Reporter`; only the number of frames is kept."""
        self._frames = frames

    def sync(self) -> None:
        """See `Reporter`."""
        self._folder.write_progress(RunProgress(self._frames, ended=False))

    def close(self) -> None:
        """See `Reporter`; nothing is pending."""


class LastVideo:
    """The video of the trained policy, recorded while other processes evaluate it.

    An error does not keep the run from storing its last checkpoint.

    Args:
        path: The file.
        game: The game.
        trainer: Its policy acts.
        page: An HTML file of the same episode; None writes none.
    """

    def __init__(
        self, path: Path, game: GameCfg, trainer: Trainer, page: Path | None = None
    ) -> None:
        self._path, self._game, self._trainer, self._page = path, game, trainer, page
        self._error: Exception | None = None

    def record(self) -> None:
        """Record it; an exception is kept for `check`."""
        policy, seed = self._trainer.policy.play, self._trainer.evaluation_seed
        try:
            with timeit("evaluate/video"):
                record_episode(self._path, self._game, policy, seed, self._page)
        except WorkerError:  # of the evaluation, which ends the run
            raise
        except Exception as error:
            self._error = error

    def check(self) -> None:
        """Raise the exception of `record`, if there was one."""
        if self._error is not None:
            raise self._error


def run_training(
    cfg: Config, folder: RunFolder | None = None, trainer: Trainer | None = None
) -> TrainingResult:
    """Train as configured, record a video and return the results.

    The video shows the most likely actions, in the world in which the first episode of evaluations
    begins: that episode itself with ``eval.exploration=deterministic``.

    Args:
        cfg: The configuration.
        folder: Folder of the run; None stores nothing on disk, and records no video.
        trainer: What `make_trainer` made from both, if it exists already.

    Raises:
        ConfigError: See `make_trainer`.
        CheckpointError: See `make_trainer`; also if a checkpoint cannot be written.
    """
    trainer = trainer or make_trainer(cfg, folder)
    if cfg.threads is None:  # a sweep gives each of its runs a share of the cores
        _log_idle_cores(cfg.collect)
        if cfg.device == "cpu":
            _warn_of_contention()
    memory = MemoryReporter()
    with ExitStack() as pending:
        written = [] if folder is None else _make_reporters(cfg, folder, trainer.progress.frames)
        for reporter in written:
            pending.callback(reporter.close)
        trainer.reporters = [memory, *written]
        video = None
        if folder is not None and cfg.log.video:
            page = folder.episode if cfg.log.episode else None
            video = LastVideo(folder.video, cfg.game, trainer, page)
            trainer.during_last_evaluation = video.record
        comparison = trainer.run()
        if video is not None and folder is not None:
            video.check()
            _report_video(trainer, folder.video)
    timing = trainer.timing()
    if folder is not None:
        folder.write("timing.txt", timing)
        folder.write("comparison.txt", "\n".join(comparison))
        folder.write_progress(RunProgress(trainer.progress.frames, ended=True))  # last
    return TrainingResult(
        memory.rows["metrics"],
        memory.rows["evaluations"],
        comparison,
        trainer.policy.play,
        timing,
        None if folder is None else folder.path,
    )


def _report_video(trainer: Trainer, path: Path) -> None:
    gif = animated_gif(path)
    for reporter in trainer.reporters:
        reporter.write_video(trainer.progress.frames, gif)


def _warn_of_contention() -> None:
    """Log that fewer threads would be faster, if other programs use the cores."""
    warning = contention_warning(torch.get_num_threads(), usable_cores(), load())
    if warning:
        _LOG.warning(warning)


def _log_idle_cores(collect: CollectCfg) -> None:
    """Log that more processes could step the worlds, if there are cores for them."""
    # the cores of a cluster are those that were reserved
    if collect.engine is Engine.ray or collect.processes is not None:
        return
    hint = idle_cores_hint(collect.groups, collect.worlds, usable_cores(), load())
    if hint:
        _LOG.info(hint)


def _make_reporters(cfg: Config, folder: RunFolder, frames: int) -> list[Reporter]:
    """Return the loggers of a run, and what writes its progress, which needs none of them."""
    return [*make_reporters(cfg, folder, frames), ProgressReporter(folder, frames)]

"""Train on a task: ``python -m veca_marl.train +task=KickTheBall``.

From Python, `veca_marl.train("KickTheBall")` does the same; see `veca_marl.api`.
"""

from __future__ import annotations

import argparse
import errno
import logging
import os
import shlex
import signal
import sys
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from veca_marl import api
from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.files import DISK_FULL, WriteError
from veca_marl.algos.training.finite import NotFiniteError
from veca_marl.algos.training.loop import Trainer
from veca_marl.config import Config, ConfigError, conf_dir, one_line, prepare, to_config
from veca_marl.config.command_line import HELP, VERSION, check_folder, print_version
from veca_marl.config.experiment import check_arm
from veca_marl.config.stored import change
from veca_marl.config.training_help import training_help
from veca_marl.processes.children import end_with_parent
from veca_marl.processes.cores import CoresError
from veca_marl.processes.supervision import WorkerError
from veca_marl.registry import unknown
from veca_marl.runs.assembly import decide_precision, make_trainer
from veca_marl.runs.continuation import RESUMABLE, may_change, resume_argument
from veca_marl.runs.lock import locked, remove_if_empty
from veca_marl.runs.run_folder import RunFolder, new_run, writable_run
from veca_marl.runs.training import TrainingResult, run_training
from veca_marl.sweeps.plans import SweepError
from veca_marl.sweeps.run_state import final_score
from veca_marl.sweeps.sweep import PARENT

_COMMAND = "python -m veca_marl.train"
_NO_FOLDER = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR)
_CONFIGURATION_ERRORS = (ConfigError, CheckpointError, WriteError)
_FAILURES = (WorkerError, NotFiniteError, FloatingPointError, CheckpointError, WriteError)


def stored_node(folder: RunFolder, overrides: list[str]) -> DictConfig:
    """Return the configuration of an earlier run, with the changes that resuming allows.

    Args:
        folder: The earlier run.
        overrides: The overrides of this command line.

    Raises:
        ConfigError: If another key is to be changed, or the run is one of another task.
    """
    node = folder.typed_config(overrides)
    named = [text for text in overrides if not text.lstrip("+").startswith("plugins=")]
    asked = dict(text.partition("=")[::2] for text in named)
    task = asked.pop("+task", node.task.name)
    if task != node.task.name:
        raise ConfigError(f"{folder.path} is a run of {node.task.name}, not of {task}")
    changed = sorted(key for key in asked if not may_change(key))
    if changed:
        raise ConfigError(
            f"a resumed run keeps its configuration: cannot change {', '.join(changed)}; "
            f"choices: {', '.join(RESUMABLE)}"
        )
    change(node, [text for text in named if not text.startswith("+task=")], RESUMABLE)
    return node


@hydra.main(version_base="1.3", config_path=str(conf_dir()), config_name="config")
def run(node: DictConfig) -> float | None:
    """Train in the folder that Hydra has created; return the score for a sweeper."""
    path = Path(HydraConfig.get().runtime.output_dir)
    with ExitStack() as pending:
        try:
            pending.enter_context(_lock(node, path))
            cfg, folder, trainer = set_up(node, path)
        except _CONFIGURATION_ERRORS as error:
            give_up(error)
        result = _train(cfg, folder, trainer)
    if HydraConfig.get().mode is not RunMode.MULTIRUN:
        return None
    try:  # in this process: `hydra/launcher=basic`, or one of another package
        return final_score(result.evaluations, asdict(cfg.experiment))
    except ValueError as error:  # sweepers that only list combinations need none
        print(f"{path} has no score for the sweeper: {error}", file=sys.stderr)
        return None


def _lock(node: DictConfig, path: Path) -> AbstractContextManager[None]:
    """Return the lock on the folder of a run; that of an earlier one has to be a run first."""
    if node.resume is not None:
        try:
            writable_run(path, "resume=")
        except ConfigError:
            remove_if_empty(path)  # Hydra creates what does not exist
            raise
    return locked(path)


def _train(cfg: Config, folder: RunFolder, trainer: Trainer) -> TrainingResult:
    """Train, print the results; failures end in one line and exit status 1."""
    path = folder.path
    try:
        result = run_training(cfg, folder, trainer)
        print(result.timing, *result.comparison, f"run folder: {folder.path}", sep="\n")
        return result
    except KeyboardInterrupt:
        print(f"\ninterrupted; {_continue(cfg, path)}", file=sys.stderr)
        raise SystemExit(130) from None
    except _FAILURES as error:
        print(f"error: {one_line(error)}; {_continue(cfg, path)}", file=sys.stderr)
        raise SystemExit(1) from error
    except OSError as error:
        if error.errno not in DISK_FULL:
            raise
        print(f"error: {error}; make room; {_continue(cfg, path)}", file=sys.stderr)
        raise SystemExit(1) from error


def _continue(cfg: Config, path: Path) -> str:
    """Return the command that continues a run; its plug-ins have to be named again."""
    plugins = [shlex.quote(f"plugins=[{','.join(cfg.plugins)}]")] if cfg.plugins else []
    return f"continue with: {' '.join([_COMMAND, *plugins, resume_argument(path)])}"


def set_up(node: DictConfig, path: Path) -> tuple[Config, RunFolder, Trainer]:
    """Return what starts or continues the run in `path`; a new folder is written last."""
    if node.resume is not None:
        folder = writable_run(path, "resume=")
        overrides = list(HydraConfig.get().overrides.task)
        stored = stored_node(folder, overrides)
        cfg = to_config(stored)
        trainer = make_trainer(cfg, folder)
        folder.begin_again(stored, overrides, trainer.progress.frames)
        return cfg, folder, trainer
    overrides = list(HydraConfig.get().overrides.task)
    check_arm(node.experiment, overrides)
    folder = new_run(path)
    decided = decide_precision(node)
    cfg = to_config(node)
    trainer = make_trainer(cfg, folder)
    for precision in dict.fromkeys(decided):
        print(f"algo.network.precision=auto: {precision.value} on this machine")
    folder.begin(node, overrides)
    return cfg, folder, trainer


def _check_folders(overrides: list[str]) -> None:
    """Raise `ConfigError` for a folder that Hydra could not create."""
    for option, _, path in (text.partition("=") for text in overrides):
        if option in ("hydra.run.dir", "hydra.sweep.dir"):
            check_folder(path, option)


def _check_config_name(words: list[str]) -> None:
    """Raise `ConfigError` for a configuration that does not exist; Hydra's lists no choices."""
    flags = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    flags.add_argument("--config-name", "-cn", default="config")
    flags.add_argument("--config-dir", "-cd", type=Path)
    flags.add_argument("--config-path", "-cp")
    known, _ = flags.parse_known_args(words)
    if known.config_path is not None:
        return
    folders = [folder for folder in (conf_dir(), known.config_dir) if folder is not None]
    names = sorted({file.stem for folder in folders for file in folder.glob("*.yaml")})
    name = known.config_name.removesuffix(".yaml")
    if name not in names and not any((folder / f"{name}.yaml").is_file() for folder in folders):
        raise ConfigError(unknown("configuration", name, names))


def give_up(error: Exception) -> NoReturn:
    """Print the error as one line and exit with status 2."""
    print(f"error: {one_line(error)}", file=sys.stderr)
    raise SystemExit(2)


def main() -> None:
    """Run the command line; errors of it end in one line and exit status 2."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra raises exceptions instead of printing them
    logging.basicConfig(format="%(message)s")
    logging.getLogger("veca_marl").setLevel(logging.INFO)
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # schedulers stop jobs with SIGTERM
    if PARENT in os.environ:  # a run of a sweep ends with it
        end_with_parent(int(os.environ.pop(PARENT)))
    if VERSION in sys.argv[1:]:
        print_version()
        return
    try:
        if any(word in HELP for word in sys.argv[1:]):
            words = [word for word in sys.argv[1:] if not word.startswith("-")]
            print(training_help(words), end="")
            return
        _check_config_name(sys.argv[1:])
        sys.argv[1:] = prepare(sys.argv[1:])
        _check_folders(sys.argv[1:])
        run()
    except (
        ConfigError, CoresError, SweepError, HydraException, OmegaConfBaseException,
    ) as error:  # fmt: skip
        give_up(error)
    except KeyboardInterrupt:  # a sweep; `run` handles that of a single run
        raise SystemExit(130) from None
    except OSError as error:
        if error.errno not in _NO_FOLDER + DISK_FULL or Path(error.filename or ".").exists():
            raise
        give_up(ConfigError(f"cannot create {error.filename}: {error.strerror}"))


class _CallableModule(ModuleType):
    """`veca_marl.train` is a function, also after this module of the same name was imported."""

    def __call__(self, *args: Any, **kwargs: Any) -> TrainingResult:
        """See `veca_marl.api.train`."""
        return api.train(*args, **kwargs)


sys.modules[__name__].__class__ = _CallableModule

if __name__ == "__main__":
    main()

"""The folder of a run: its files, how it is created and how it is opened again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from omegaconf import DictConfig, OmegaConf
from yaml import YAMLError

from veca_marl.algos.files import write_atomically
from veca_marl.config import ConfigError, one_line
from veca_marl.config.stored import body_names, typed
from veca_marl.runs.continuation import resume_argument
from veca_marl.runs.provenance import provenance
from veca_marl.runs.run_progress import FILE as PROGRESS_FILE
from veca_marl.runs.run_progress import RunProgress


@dataclass(frozen=True)
class RunFolder:
    """The files in the folder of a run.

    Attributes:
        path: The folder.
    """

    path: Path

    @property
    def config(self) -> Path:
        """The resolved configuration."""
        return self.path / "config.yaml"

    @property
    def checkpoints(self) -> Path:
        """The folder of the checkpoints."""
        return self.path / "checkpoints"

    @property
    def video(self) -> Path:
        """An episode of the trained policy."""
        return self.path / "videos" / "final.mp4"

    @property
    def pool(self) -> Path:
        """The folder of past policies (self-play)."""
        return self.path / "pool"

    @property
    def provenance(self) -> Path:
        """Command line, commit and versions of the run."""
        return self.path / "provenance.json"

    @property
    def progress(self) -> Path:
        """How far the run has come."""
        return self.path / PROGRESS_FILE

    @property
    def identifier(self) -> str:
        """A name that no other run has, by which loggers continue the curves of a resumed run."""
        stored = self._read_provenance() if self.provenance.exists() else {}
        # runs of earlier versions have none stored; theirs was made of the path
        return str(stored.get("id", "-".join(self.path.resolve().parts[-2:])))

    def begin(self, node: DictConfig, overrides: Sequence[str]) -> None:
        """Create the folder with the configuration and the provenance of the run."""
        # from the system's entropy: no generator of the run is touched
        content = {"id": uuid4().hex, **provenance(overrides), "bodies": body_names(node)}
        self._write_json(self.provenance, content)
        write_atomically(self.config, OmegaConf.to_yaml(node, resolve=True))  # last: it is a run

    def begin_again(self, node: DictConfig, overrides: Sequence[str], frames: int) -> None:
        """Store how a run is continued.

        The configuration is written anew: resuming the run once more without overrides keeps its
        budgets, and what reads the folder knows them.

        Args:
            node: The configuration from now on.
            overrides: Those of the command line.
            frames: Number of frames after which the run continues.
        """
        content = self._read_provenance()
        again = {"frames": frames, **provenance(overrides)}
        content.setdefault("resumed", []).append(again)
        self._write_json(self.provenance, content)
        self.write_progress(RunProgress(frames, ended=False))  # before a budget that it may reach
        stored = node.copy()
        stored.resume = None
        write_atomically(self.config, OmegaConf.to_yaml(stored, resolve=True))

    def typed_config(self) -> DictConfig:
        """Return the configuration stored with the run, with the types that it had.

        Raises:
            ConfigError: If it cannot be read, or was stored by a version with another one.
        """
        bodies = self._read_provenance().get("bodies")
        if bodies is None:
            raise ConfigError(f"{self.path} was stored by an older version; train it again")
        try:
            stored = OmegaConf.load(self.config)
        except (OSError, YAMLError, UnicodeDecodeError) as error:
            raise _damaged(self.config, error) from error
        if not isinstance(stored, DictConfig) or OmegaConf.select(stored, "task.name") is None:
            raise ConfigError(f"{self.config} is damaged: it names no task")
        try:
            return typed(stored, bodies)
        except ConfigError as error:
            raise ConfigError(f"{self.config}: {error}") from error

    def _read_provenance(self) -> dict[str, Any]:
        try:
            content = json.loads(self.provenance.read_text())
        except (OSError, ValueError) as error:
            raise _damaged(self.provenance, error) from error
        if not isinstance(content, dict):
            raise ConfigError(f"{self.provenance} is damaged: it is no table")
        return content

    @staticmethod
    def _write_json(path: Path, content: dict[str, Any]) -> None:
        write_atomically(path, json.dumps(content, indent=2) + "\n")

    def write_progress(self, progress: RunProgress) -> None:
        """Write how far the run has come."""
        write_atomically(self.progress, progress.text)

    def write(self, name: str, text: str) -> None:
        """Write a small text file."""
        write_atomically(self.path / name, text + "\n")


def _damaged(path: Path, error: Exception) -> ConfigError:
    return ConfigError(f"{path} is damaged or cannot be read: {one_line(error)}")


def new_run(path: Path) -> RunFolder:
    """Return the folder of a new run.

    Raises:
        ConfigError: If there is a run in it already.
    """
    folder = RunFolder(path)
    if folder.config.exists():
        raise ConfigError(f"{path} holds a run already; continue it with {resume_argument(path)}")
    return folder


def open_run(path: Path, asked_by: str = "") -> RunFolder:
    """Return the folder of an earlier run.

    Args:
        path: The folder.
        asked_by: The option that named it; the error message begins with it.

    Raises:
        ConfigError: If there is no run in `path`.
    """
    folder = RunFolder(path)
    if not path.exists():
        raise ConfigError(f"{asked_by}{path} does not exist; give the folder of a run")
    if not folder.config.is_file():
        raise ConfigError(f"{asked_by}{path} holds no run (no config.yaml)")
    return folder

"""The folder of a run: its files, how it is created and how it is opened again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from omegaconf import DictConfig, OmegaConf

from veca_marl.config import ConfigError
from veca_marl.config.stored import body_names, typed
from veca_marl.runs.provenance import provenance


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

    def begin(self, node: DictConfig, overrides: Sequence[str]) -> None:
        """Create the folder with the configuration and the provenance of the run."""
        self.path.mkdir(parents=True, exist_ok=True)
        content = {**provenance(overrides), "bodies": body_names(node)}
        self.provenance.write_text(json.dumps(content, indent=2) + "\n")
        self.config.write_text(OmegaConf.to_yaml(node, resolve=True))

    def typed_config(self) -> DictConfig:
        """Return the configuration stored with the run, with the types that it had.

        Raises:
            ConfigError: If it was stored by a version with another configuration.
        """
        bodies = json.loads(self.provenance.read_text()).get("bodies")
        if bodies is None:
            raise ConfigError(f"{self.path} was stored by an older version; train it again")
        try:
            return typed(cast(DictConfig, OmegaConf.load(self.config)), bodies)
        except ConfigError as error:
            raise ConfigError(f"{self.config}: {error}") from error

    def write(self, name: str, text: str) -> None:
        """Write a small text file."""
        (self.path / name).write_text(text + "\n")


def new_run(path: Path) -> RunFolder:
    """Return the folder of a new run.

    Raises:
        ConfigError: If there is a run in it already.
    """
    folder = RunFolder(path)
    if folder.config.exists():
        raise ConfigError(f"{path} holds a run already; continue it with resume={path}")
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
    if not folder.config.is_file():
        raise ConfigError(f"{asked_by}{path} holds no run (no config.yaml)")
    return folder


def remove_if_empty(path: Path) -> None:
    """Remove the folder of a run that could not be started."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()

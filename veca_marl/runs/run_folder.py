"""The folder of a run: what is in it, and that no run writes into another's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from omegaconf import DictConfig, OmegaConf

from veca_marl.config import ConfigError, compose_node
from veca_marl.runs.provenance import provenance


@dataclass(frozen=True)
class RunFolder:
    """Where things are in the folder of a run.

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
        """The folder of past selves."""
        return self.path / "pool"

    @property
    def provenance(self) -> Path:
        """How the run came about."""
        return self.path / "provenance.json"

    def begin(self, node: DictConfig, overrides: Sequence[str]) -> None:
        """Claim the folder: write down what the run is."""
        self.path.mkdir(parents=True, exist_ok=True)
        self.provenance.write_text(json.dumps(provenance(overrides), indent=2) + "\n")
        self.config.write_text(OmegaConf.to_yaml(node, resolve=True))

    @property
    def overrides(self) -> list[str]:
        """What the command line of the run said."""
        overrides: list[str] = json.loads(self.provenance.read_text())["overrides"]
        return overrides

    def typed_config(self) -> DictConfig:
        """Return the configuration of the run, with the types that its choices have."""
        return cast(DictConfig, OmegaConf.merge(compose_node(self.overrides), self._stored()))

    def _stored(self) -> DictConfig:
        return cast(DictConfig, OmegaConf.load(self.config))

    def write(self, name: str, text: str) -> None:
        """Write a small text file."""
        (self.path / name).write_text(text + "\n")


def new_run(path: Path) -> RunFolder:
    """Return the folder of a run that has not begun.

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
        asked_by: What the error begins with.

    Raises:
        ConfigError: If there is no run in `path`.
    """
    folder = RunFolder(path)
    if not folder.config.is_file():
        raise ConfigError(f"{asked_by}{path} holds no run (no config.yaml)")
    return folder


def remove_if_empty(path: Path) -> None:
    """Remove a folder that was made for a run that did not come about."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()

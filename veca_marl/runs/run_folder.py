"""The folder of a run: its files, where it comes from, and what the run has learnt."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast
from uuid import uuid4

from omegaconf import DictConfig, OmegaConf
from tensordict.nn import TensorDictModuleBase

from veca_marl.algos.demonstration_files import Card
from veca_marl.algos.files import left_behind, write_atomically
from veca_marl.algos.policy_files import read_policy
from veca_marl.algos.selfplay import SelfPlayCfg
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.transfer import load_actor
from veca_marl.config import Config, ConfigError, to_config
from veca_marl.config.compose import load_config_plugins
from veca_marl.config.overrides import plugins_in
from veca_marl.config.stored import body_names, change, typed
from veca_marl.migrations import numbered
from veca_marl.policy_paths import SUFFIX
from veca_marl.runs.continuation import FILE as PROGRESS_FILE
from veca_marl.runs.continuation import RunProgress, resume_argument
from veca_marl.runs.lock import check_links
from veca_marl.stored_files import StoredFileError, read_json, read_yaml
from veca_marl.version import __version__

_PACKAGES = ("torch", "torchrl", "tensordict", "pybullet", "numpy", "numba")


def provenance(overrides: Sequence[str]) -> dict[str, object]:
    """Return what `provenance.json` of a run contains."""
    packages = {"veca_marl": __version__}
    return {
        "command": sys.orig_argv,
        "overrides": list(overrides),
        "commit": checkout_commit(),
        "python": platform.python_version(),
        "packages": packages | {name: version(name) for name in _PACKAGES},
    }


def checkout_commit(package: Path = Path(__file__).parents[1]) -> str | None:
    """Return the commit of the checkout that the package lies in, with `-dirty` if it was changed.

    None for an installed package, also where its environment lies inside another repository: the
    package has to lie directly in the top folder of the repository and be tracked by it.

    Args:
        package: The folder of the package.
    """
    top = _git(package, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != package.parent.resolve():
        return None
    if _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    return _git(package, "describe", "--always", "--abbrev=40", "--dirty", "--exclude", "*")


def _git(folder: Path, *arguments: str) -> str | None:
    """Return the output of a git command; None if it fails or git is not installed."""
    environment = {name: text for name, text in os.environ.items() if not name.startswith("GIT_")}
    try:
        done = subprocess.run(
            ["git", *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


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
    def episode(self) -> Path:
        """The same episode as a page for browsers."""
        return self.path / "videos" / "episode.html"

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
        if node.demonstrations is not None:
            content["demonstrations"] = Card.read(Path(node.demonstrations)).checksum
        self._write_json(self.provenance, content)
        self._write_config(node)  # last: it is a run

    @property
    def demonstrations(self) -> str | None:
        """Checksum of the demonstrations that the run learns from; None if none is stored."""
        found = self._read_provenance().get("demonstrations")
        return None if found is None else str(found)

    def begin_again(self, node: DictConfig, overrides: Sequence[str], frames: int) -> None:
        """Store how a run is continued.

        The configuration is written anew: resuming the run once more without overrides keeps its
        budgets, and what reads the folder knows them.

        Args:
            node: The configuration from now on.
            overrides: Those of the command line.
            frames: Number of frames after which the run continues.
        """
        self._remove_left_behind()
        content = self._read_provenance()
        again = {"frames": frames, **provenance(overrides)}
        content.setdefault("resumed", []).append(again)
        self._write_json(self.provenance, content)
        self.write_progress(RunProgress(frames, ended=False))  # before a budget that it may reach
        stored = node.copy()
        stored.resume = None
        self._write_config(stored)

    def _remove_left_behind(self) -> None:
        """Remove the temporary files of processes that were killed: this one holds the lock."""
        ours = (self.config, self.provenance, self.progress, self.video, self.episode)
        names = re.compile("|".join(re.escape(path.name) for path in ours))
        for folder in (self.path, self.video.parent):
            for path in left_behind(folder, names):
                path.unlink()

    def _write_config(self, node: DictConfig) -> None:
        plain = cast(dict[str, Any], OmegaConf.to_container(node, resolve=True))
        write_atomically(self.config, OmegaConf.to_yaml(numbered(plain)))

    def typed_config(self, overrides: Sequence[str] = ()) -> DictConfig:
        """Return the configuration stored with the run, with the types that it had.

        Args:
            overrides: Those of the command line, which must name the plug-ins of the run that are
                not installed.

        Raises:
            ConfigError: If it cannot be read, was stored by a version with another one, or needs a
                plug-in that is not loaded.
        """
        load_config_plugins(plugins_in(overrides))
        bodies = self._read_provenance().get("bodies")
        if bodies is None:
            raise ConfigError(f"{self.path} was stored by an older version; train it again")
        try:
            stored = read_yaml(self.config)
        except StoredFileError as error:
            raise ConfigError(str(error)) from error
        try:
            return typed(stored, bodies)
        except ConfigError as error:
            raise ConfigError(f"{self.config}: {error}") from error

    def _read_provenance(self) -> dict[str, Any]:
        try:
            content = read_json(self.provenance)
            check_provenance(self.provenance, content)
        except StoredFileError as error:
            raise ConfigError(str(error)) from error
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


_IDENTIFIER = re.compile(r"[\w.-]{1,128}")  # it is part of paths and queries of loggers


def check_provenance(path: Path, content: Mapping[str, Any]) -> None:
    """Check the types of what is read of a `provenance.json`; any entry may be absent.

    Args:
        path: The file.
        content: What it holds.

    Raises:
        StoredFileError: If one is of another type.
    """
    bodies, again = content.get("bodies"), content.get("resumed", [])
    identifier = content.get("id", "none")
    if bodies is not None and not (
        isinstance(bodies, dict) and all(isinstance(name, str) for name in bodies.values())
    ):
        raise StoredFileError(path, "'bodies' does not map the keys of bodies to their names")
    if not isinstance(again, list):
        raise StoredFileError(path, "'resumed' is no list")
    if not (isinstance(identifier, str) and _IDENTIFIER.fullmatch(identifier)):
        raise StoredFileError(path, "'id' is no identifier of a run")


_WRITTEN = (
    "progress.json",
    "metrics.csv",
    "evaluations.csv",
    "timing.txt",
    "comparison.txt",
    "checkpoints",
    "pool",
    "videos/final.mp4",
    "videos/episode.html",
)
_LINKABLE = ("provenance.json", "videos", "tensorboard", "wandb", "mlflow.db")


def new_run(path: Path) -> RunFolder:
    """Return the folder of a new run.

    Raises:
        ConfigError: If there is a run in it already, a file that the run would overwrite, a
            symbolic link in place of one, or characters in its name that loggers cannot write.
    """
    folder = RunFolder(path)
    check_characters(path)
    if folder.config.exists():
        raise ConfigError(f"{path} holds a run already; continue it with {resume_argument(path)}")
    check_links(path, (folder.config.name, *_LINKABLE, *_WRITTEN))
    for name in _WRITTEN:
        if (path / name).exists():
            raise ConfigError(
                f"{path / name} exists, and {path} holds no run (no config.yaml): nothing is "
                "overwritten; choose another folder"
            )
    return folder


def writable_run(path: Path, asked_by: str) -> RunFolder:
    """Return the folder of an earlier run, to write to it.

    Args:
        path: See `open_run`.
        asked_by: See `open_run`.

    Raises:
        ConfigError: If there is no run in `path`, a symbolic link in its folder, or characters in
            its name that loggers cannot write.
    """
    folder = open_run(path, asked_by)
    check_characters(path)
    check_links(path)
    return folder


def check_characters(path: Path) -> None:
    """Check that Python can write a name in UTF-8, as loggers do.

    Raises:
        ConfigError: If it cannot: in an ASCII locale Python does not know other characters.
    """
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError:
        raise ConfigError(
            f"{path}: Python cannot write these characters in the locale of this process; set "
            "PYTHONUTF8=1, or choose another folder"
        ) from None


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


def stored_configuration(checkpoint: Path, overrides: Sequence[str], asked_by: str) -> Config:
    """Return the configuration stored with a run, changed by overrides, for playing alone.

    Args:
        checkpoint: Folder of a run, or a checkpoint in it.
        overrides: Changes of the configuration.
        asked_by: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If there is no run, or a change is impossible.
    """
    if checkpoint.is_file() and checkpoint.suffix not in (".pt", SUFFIX):
        raise ConfigError(f"{asked_by}{checkpoint} is no checkpoint; give a run, or a checkpoint")
    if checkpoint.suffix == SUFFIX and not checkpoint.is_dir():
        node = _policy_configuration(checkpoint, overrides)
    else:
        named = checkpoint.parent.parent if checkpoint.is_file() else checkpoint
        node = open_run(named, asked_by).typed_config(overrides)
    # nothing is learnt here
    node.self_play, node.learner, node.init_from, node.init_encoders = SelfPlayCfg(), {}, {}, {}
    node.team_intrinsic = {}
    change(node, overrides)
    return to_config(node)


def _policy_configuration(path: Path, overrides: Sequence[str]) -> DictConfig:
    """Return the configuration in the file of a policy, with the types that it had.

    Raises:
        CheckpointError: If the file cannot be read.
        ConfigError: If the configuration has no counterpart in this version.
    """
    load_config_plugins(plugins_in(overrides))
    about = read_policy(path)["about"]
    try:
        check_provenance(path, {"bodies": about.get("bodies")})
        return typed(dict(about["config"]), dict(about["bodies"]))
    except (StoredFileError, ConfigError, LookupError, TypeError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from error


def stored_actors(
    cfg: Config, checkpoint: Path, specs: Mapping[str, TeamSpec]
) -> dict[str, TensorDictModuleBase]:
    """Return the policy of each team that is not scripted.

    Args:
        cfg: What `stored_configuration` returned; its `frozen` teams have policies of other runs.
        checkpoint: Folder of the run, or a checkpoint in it.
        specs: The arrays of the teams.

    Raises:
        CheckpointError: If a policy does not fit.
    """
    return {
        team: load_actor(cfg.frozen.get(team, checkpoint), team, spec)
        for team, spec in specs.items()
    }

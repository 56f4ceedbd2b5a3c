"""Checkpoints: written so that none is damaged, checked when read, bound to task and specs."""

from __future__ import annotations

import io
import pickle
import re
import signal
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import torch

from veca_marl.algos.files import WriteError, left_behind, write_atomically
from veca_marl.algos.specs import TeamSpec
from veca_marl.migrations import CONFIG_VERSION, KEY, VersionError, migrated_checkpoint

# 3: actions have named parts, and each team an algorithm of its own
FORMAT = 3
_KEYS = {"identity", "config", "algorithms", "state"}
_CPU = torch.device("cpu")
# what torch.load raises for files that are cut off or have other content
_UNREADABLE = (RuntimeError, EOFError, pickle.UnpicklingError, ValueError, KeyError, TypeError)


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written, read, or used here."""


def read_checkpoint(path: Path, device: torch.device) -> dict[str, Any]:
    """Return everything that is in the file of a checkpoint.

    Raises:
        CheckpointError: If it cannot be read, or is not a checkpoint of this version.
    """
    return _checked(path, load_file(path, device))


def map_checkpoint(path: Path) -> dict[str, Any]:
    """Return what `read_checkpoint` returns; of its tensors, the disk is read when they are used.

    A replay buffer in a checkpoint thus takes neither memory nor time where only a network is
    wanted. The file has to stay as it is until the tensors have been copied.

    Raises:
        CheckpointError: See `read_checkpoint`.
    """
    return _checked(path, _load(path, map_location=_CPU, mmap=True))


def _checked(path: Path, content: Any) -> dict[str, Any]:
    """Return the content of a file, in the form of this version, if it is a checkpoint of it."""
    if not isinstance(content, dict) or "format" not in content:
        raise CheckpointError(f"{path} is not a checkpoint of a run")
    if content["format"] != FORMAT:
        raise CheckpointError(
            f"{path} has format {content['format']}, this version reads format {FORMAT}"
        )
    missing = sorted(_KEYS - set(content))
    if missing:
        raise CheckpointError(f"{path} is incomplete: no {', '.join(missing)}")
    try:
        return migrated_checkpoint(content)
    except VersionError as error:
        raise CheckpointError(f"{path}: {error}") from error


def load_file(path: Path, device: torch.device) -> Any:
    """Return the tensors and plain data in a file that `torch.save` wrote.

    Raises:
        CheckpointError: If it cannot be read.
    """
    return _load(path, map_location=device)


def _load(path: Path, **options: Any) -> Any:
    try:
        return torch.load(path, weights_only=True, **options)
    except FileNotFoundError as error:
        raise CheckpointError(f"{path} does not exist") from error
    except (OSError, *_UNREADABLE) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise CheckpointError(f"cannot read {path} (cut off or no checkpoint): {reason}") from error


@contextmanager
def load_errors(path: Path) -> Iterator[None]:
    """Raise `CheckpointError` where a state that is loaded inside the block does not fit."""
    try:
        yield
    except (RuntimeError, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise CheckpointError(f"{path} does not fit: {type(error).__name__}: {reason}") from error


_ABSENT = "absent"


@dataclass(frozen=True)
class Identity:
    """What a checkpoint belongs to.

    Attributes:
        task: Name of the task.
        specs: Team name to its arrays.
    """

    task: str
    specs: dict[str, TeamSpec]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"task": self.task, "specs": {t: s.to_dict() for t, s in self.specs.items()}}


def check_identity(path: Path, stored: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Check that a stored identity is the wanted one.

    Raises:
        CheckpointError: If the checkpoint at `path` is of another task or other specs.
    """
    if stored["task"] != wanted["task"]:
        raise CheckpointError(f"{path} is of task {stored['task']}, wanted: {wanted['task']}")
    differing = [
        f"{name}: {in_file} in the checkpoint, {in_run} in this run"
        for name, in_file, in_run in _differences(stored["specs"], wanted["specs"])
    ]
    if differing:
        raise CheckpointError(f"{path} was made for other specs: {'; '.join(differing)}")


def spec_differences(stored: dict[str, Any], spec: TeamSpec) -> str:
    """Return how a stored specification differs from `spec`; empty if it does not."""
    return "; ".join(
        f"{name}: {in_file} in the checkpoint, {in_run} in this run"
        for name, in_file, in_run in _differences(stored, spec.to_dict())
    )


def _differences(one: Any, other: Any, name: str = "") -> list[tuple[str, Any, Any]]:
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            found
            for key in sorted({*one, *other})
            for found in _differences(
                one.get(key, _ABSENT), other.get(key, _ABSENT), f"{name}.{key}".lstrip(".")
            )
        ]
    return [] if one == other else [(name, one, other)]


def check_config(
    path: Path,
    stored: dict[str, Any],
    config: dict[str, Any],
    may_change: Collection[str],
    by_team: Collection[str] = (),
) -> None:
    """Check that a configuration is the stored one; fields of newer versions are ignored.

    Args:
        path: The checkpoint.
        stored: Its configuration as plain data.
        config: That of the run that is to continue.
        may_change: First parts of the keys in which they may differ.
        by_team: Keys of mappings from the names of teams: an entry that the stored ones do not
            have is a difference.

    Raises:
        CheckpointError: If they differ elsewhere.
    """
    differing = [
        f"{name} was {before}, is {now}"
        for name, before, now in _differences(stored, config)
        if (before != _ABSENT or _is_entry(name, by_team))
        and name.partition(".")[0] not in may_change
    ]
    if differing:
        raise CheckpointError(
            f"{path} is of another configuration: {'; '.join(differing)}; "
            f"a resumed run may change {', '.join(may_change) or 'nothing'}"
        )


def _is_entry(name: str, mappings: Collection[str]) -> bool:
    """Return whether a key is that of an entry of one of some mappings."""
    mapping, _, entry = name.partition(".")
    return mapping in mappings and "." not in entry


_DELAYED = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGCHLD") if name in dir(signal)
]


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Delay what signals raise until the block is done; inside it torch would raise another error.

    They are Ctrl-C, the request to end, and the end of a worker process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    received: list[int] = []
    previous = {number: signal.getsignal(number) for number in _DELAYED}
    delayed = {number: action for number, action in previous.items() if callable(action)}
    for number in delayed:
        signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, action in delayed.items():
            signal.signal(number, action)
    for number in received:
        signal.raise_signal(number)


_BEST = "best.pt"
_BY_FRAMES = re.compile(r"frames_(\d{12,})\.pt", re.ASCII)
_NAMES = re.compile(f"{_BY_FRAMES.pattern}|{re.escape(_BEST)}", re.ASCII)


def checkpoints_in(folder: Path) -> list[Path]:
    """Return the checkpoints in a folder by their frames, in ascending order, without the best."""
    return sorted(path for path in folder.glob("frames_*.pt") if _BY_FRAMES.fullmatch(path.name))


class Checkpoints:
    """The checkpoints of one run.

    Each file holds the format, the version of its configurations, the identity, the configuration
    of the run, the numbers of each team's algorithm, and under ``state`` what `save` was given.

    Args:
        folder: Where they are; created at the first save. None keeps nothing.
        identity: What they belong to.
        config: The run's configuration as plain data.
        keep_last: Number of the latest that are kept, beside the best one.
        may_change: Keys of `config` in which a checkpoint that is loaded may differ from it.
        by_team: Keys of `config` that are mappings from the names of teams.
    """

    def __init__(
        self,
        folder: Path | None,
        identity: Identity,
        config: dict[str, Any],
        keep_last: int = 3,
        may_change: Collection[str] = (),
        by_team: Collection[str] = (),
    ) -> None:
        self.folder, self.identity, self.config = folder, identity, config
        self.keep_last, self.may_change, self.by_team = keep_last, may_change, by_team

    def save(
        self,
        state: dict[str, Any],
        frames: int,
        best: bool,
        algorithms: Mapping[str, Any] | None = None,
    ) -> Path | None:
        """Write `state`, then remove checkpoints that are too old.

        Args:
            state: Tensors and plain data.
            frames: Training frames so far: the file's name.
            best: Whether it is the best so far.
            algorithms: Team to the numbers of its algorithm as plain data.

        Returns:
            The file; None without a folder.

        Raises:
            CheckpointError: If it cannot be written; earlier checkpoints are unchanged.
        """
        if self.folder is None:
            return None
        path = self.folder / f"frames_{frames:012d}.pt"
        content = {
            "format": FORMAT,
            KEY: CONFIG_VERSION,
            "identity": self.identity.to_dict(),
            "config": self.config,
            "algorithms": dict(algorithms or {}),
            "state": state,
        }
        with interrupts_wait():
            file = io.BytesIO()
            torch.save(content, file)
            if best:  # first: a run that is killed in between writes both again
                self._write(file.getbuffer(), self.folder / _BEST)
            self._write(file.getbuffer(), path)
        self.remove_old()
        return path

    def load(self, path: Path, device: torch.device) -> dict[str, Any]:
        """Return the state in one of the checkpoints, from which the run is to continue.

        Raises:
            CheckpointError: If it cannot be read, or belongs to another task, other specs or
                another configuration.
        """
        try:
            content = read_checkpoint(path, device)
        except CheckpointError as error:
            earlier = [file for file in self._files() if file < path]
            if not earlier:
                raise
            raise CheckpointError(
                f"{error}; remove it to continue from {earlier[-1].name}"
            ) from error
        check_identity(path, content["identity"], self.identity.to_dict())
        check_config(path, content["config"], self.config, self.may_change, self.by_team)
        state: dict[str, Any] = content["state"]
        return state

    @property
    def empty(self) -> bool:
        """Whether there is no checkpoint."""
        return not self._files()

    def remove_old(self) -> None:
        """Remove checkpoints that are too old, and temporary files of killed processes."""
        for old in self._files()[: -self.keep_last]:
            old.unlink()
        if self.folder is not None:
            for unfinished in left_behind(self.folder, _NAMES):
                unfinished.unlink()

    def latest(self) -> Path:
        """Return the newest checkpoint.

        Raises:
            CheckpointError: If there is none.
        """
        files = self._files()
        if not files:
            raise CheckpointError(f"no checkpoint in {self.folder}")
        return files[-1]

    def _files(self) -> list[Path]:
        return [] if self.folder is None else checkpoints_in(self.folder)

    def _write(self, content: memoryview, path: Path) -> None:
        try:
            write_atomically(path, content)
        except WriteError as error:
            kept = self._files()
            last = kept[-1] if kept else "none"
            raise CheckpointError(f"{error}; the last intact checkpoint is {last}") from error


T = TypeVar("T")


def to_plain(value: Any) -> Any:
    """Return dictionaries, lists, numbers and strings; an Enum becomes its name."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: to_plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(entry) for entry in value]
    return value.name if isinstance(value, Enum) else value


def from_plain(kind: type[T], plain: dict[str, Any], find: Callable[[type, str], type]) -> T:
    """Return the dataclass that `to_plain` was given.

    Args:
        kind: Its type, or the base class of it.
        plain: What `to_plain` returned.
        find: Returns the type for a base class and the `name` that the plain data hold, for
            dataclasses that are chosen from a registry. Fields that `plain` does not have take
            their defaults.

    Raises:
        ValueError: If a field is unknown.
    """
    actual = find(kind, plain["name"]) if "name" in plain else kind
    hints = get_type_hints(actual)
    unknown = sorted(set(plain) - set(hints))
    if unknown:
        raise ValueError(f"{actual.__name__} has no fields {unknown}")
    values = {name: _restore(hints[name], value, find) for name, value in plain.items()}
    made: T = actual(**values)
    return made


def _restore(hint: Any, value: Any, find: Callable[[type, str], type]) -> Any:
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint[value]
    if is_dataclass(hint) and isinstance(hint, type):
        return from_plain(hint, value, find)
    return value

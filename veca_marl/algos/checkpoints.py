"""Checkpoints: written so that none is damaged, checked when read, bound to task and specs."""

from __future__ import annotations

import io
import re
import reprlib
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import torch

from veca_marl.algos.checkpoint_files import (
    FORMAT,
    CheckpointError,
    load_errors,
    load_file,
    map_checkpoint,
    read_checkpoint,
)
from veca_marl.algos.files import WriteError, left_behind, write_atomically
from veca_marl.algos.specs import TeamSpec
from veca_marl.migrations import CONFIG_VERSION, KEY
from veca_marl.override_text import is_within

__all__ = [
    "FORMAT",
    "CheckpointError",
    "Checkpoints",
    "Identity",
    "check_config",
    "check_identity",
    "checkpoints_in",
    "from_plain",
    "interrupts_wait",
    "load_errors",
    "load_file",
    "map_checkpoint",
    "read_checkpoint",
    "spec_differences",
    "to_plain",
]

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
        raise CheckpointError(
            f"{path} is of task {_shown(stored['task'])}, wanted: {wanted['task']}"
        )
    if differing := _in_words(stored["specs"], wanted["specs"]):
        raise CheckpointError(f"{path} was made for other specs: {differing}")


def spec_differences(stored: dict[str, Any], spec: TeamSpec) -> str:
    """Return how a stored specification differs from `spec`; empty if it does not."""
    return _in_words(stored, spec.to_dict())


def _in_words(stored: dict[str, Any], wanted: dict[str, Any]) -> str:
    return _listed(
        f"{name}: {_shown(in_file)} in the checkpoint, {_shown(in_run)} in this run"
        for name, in_file, in_run in _differences(stored, wanted)
    )


_MOST_LISTED = 8


def _listed(texts: Iterable[str]) -> str:
    every = list(texts)
    more = f"; and {len(every) - _MOST_LISTED} more" if len(every) > _MOST_LISTED else ""
    return "; ".join(every[:_MOST_LISTED]) + more


_BRIEF = reprlib.Repr()
_BRIEF.maxstring = _BRIEF.maxother = 80
_BRIEF.maxlevel = 2


def _shown(value: Any) -> str:
    """Return a value as it is written in a message: a stored one may have any size."""
    return value if isinstance(value, str) and len(value) <= 80 else _BRIEF.repr(value)


def _differences(one: Any, other: Any, name: str = "") -> list[tuple[str, Any, Any]]:
    """Return the dotted key, and both values, wherever two plain values differ.

    Lists of mappings, such as the props of a playground, are compared element by element.
    """
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            found
            for key in sorted({*one, *other})
            for found in _differences(
                one.get(key, _ABSENT), other.get(key, _ABSENT), f"{name}.{key}".lstrip(".")
            )
        ]
    if _has_mappings(one) and _has_mappings(other):
        if len(one) != len(other):
            return [(name, f"{len(one)} entries", f"{len(other)} entries")]
        return [
            found
            for index, (before, now) in enumerate(zip(one, other, strict=True))
            for found in _differences(before, now, f"{name}.{index}")
        ]
    return [] if one == other else [(name, one, other)]


def _has_mappings(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(entry, dict) for entry in value)


def check_config(
    path: Path,
    stored: dict[str, Any],
    config: dict[str, Any],
    may_change: Collection[str],
    is_default: Callable[[str], bool],
) -> None:
    """Check that a configuration is the stored one.

    A field that the stored one does not have is one of a newer version: with its default value,
    it is no difference.

    Args:
        path: The checkpoint.
        stored: Its configuration as plain data.
        config: That of the run that is to continue.
        may_change: Keys, or parts of the configuration, in which they may differ.
        is_default: Whether a dotted key of `config` is a field, with its default value.

    Raises:
        CheckpointError: If they differ elsewhere; the message names the keys that do.
    """
    differing = [
        f"{name} was {_shown(before)}, is {_shown(now)}"
        for name, before, now in _differences(stored, config)
        if not is_within(name, may_change) and not (before == _ABSENT and is_default(name))
    ]
    if differing:
        raise CheckpointError(
            f"{path} is of another configuration: {_listed(differing)}; "
            f"a resumed run may change {', '.join(may_change) or 'nothing'}"
        )


def _of_a_newer_version(key: str) -> bool:
    return True


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
        is_default: Whether a key of `config` that a checkpoint does not have is a field with its
            default value, see `check_config`. By default, every such key is one.
    """

    def __init__(
        self,
        folder: Path | None,
        identity: Identity,
        config: dict[str, Any],
        keep_last: int = 3,
        may_change: Collection[str] = (),
        is_default: Callable[[str], bool] = _of_a_newer_version,
    ) -> None:
        self.folder, self.identity, self.config = folder, identity, config
        self.keep_last, self.may_change, self.is_default = keep_last, may_change, is_default

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
        check_config(path, content["config"], self.config, self.may_change, self.is_default)
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
        ValueError: If a field is unknown, or a value is not of its type.
    """
    actual: Any = find(kind, plain["name"]) if "name" in plain else kind
    hints = get_type_hints(actual)
    unknown = sorted(set(plain) - {field.name for field in fields(actual)})
    if unknown:
        raise ValueError(f"{actual.__name__} has no fields {unknown}")
    for name, value in plain.items():
        if not _fits(hints[name], value):
            raise ValueError(f"{actual.__name__}.{name}={value!r:.80} is of another type")
    values = {name: _restore(hints[name], value, find) for name, value in plain.items()}
    made: T = actual(**values)
    return made


def _restore(hint: Any, value: Any, find: Callable[[type, str], type]) -> Any:
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint[value]
    if is_dataclass(hint) and isinstance(hint, type):
        return from_plain(hint, value, find)
    return value


def _fits(hint: Any, value: Any) -> bool:
    """Return whether `to_plain` can have made `value` of a value with the annotation `hint`."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(part, value) for part in parts)
    if origin in (list, tuple, Sequence):
        return isinstance(value, list) and all(_fits(parts[0], each) for each in value)
    if origin in (dict, Mapping):
        return isinstance(value, dict) and all(_fits(parts[1], each) for each in value.values())
    if hint is float:
        return type(value) in (int, float)
    if hint is int:
        return type(value) is int
    if hint is Any or not isinstance(hint, type):
        return True
    if issubclass(hint, Enum):
        return isinstance(value, str) and value in hint.__members__
    return isinstance(value, dict if is_dataclass(hint) else hint)

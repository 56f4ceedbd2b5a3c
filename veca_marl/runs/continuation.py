"""How far a run has come, how it is continued, and what may then be changed."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from veca_marl.override_text import is_within, quoted
from veca_marl.stored_files import StoredFileError, read_json

FILE = "progress.json"


@dataclass(frozen=True)
class RunProgress:
    """Where a run stands.

    Attributes:
        frames: Frames learnt from until its last checkpoint, or its end.
        ended: Whether it has ended by its budget, with all of its files.
    """

    frames: int
    ended: bool

    @property
    def text(self) -> str:
        """The content of the file."""
        return json.dumps(asdict(self)) + "\n"


def read_progress(folder: Path) -> RunProgress | None:
    """Return what the file in the folder of a run says.

    Returns:
        None without a file: the run has no checkpoint yet, or was stored by version 0.2.

    Raises:
        StoredFileError: If the file cannot be read.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    content = read_json(path)
    frames, ended = content.get("frames"), content.get("ended")
    if type(frames) is not int or frames < 0 or type(ended) is not bool:
        raise StoredFileError(path, "it has no number of 'frames', or not whether it has 'ended'")
    return RunProgress(frames, ended)


_PLAIN = re.compile(r"[\w./-]*/[\w./-]*", re.ASCII)  # a single word may be a number, or null


def resume_argument(path: str | Path) -> str:
    """Return what continues the run in a folder, to be copied into a shell."""
    value = str(path) if _PLAIN.fullmatch(str(path)) else quoted(path)
    return shlex.quote(f"resume={value}")


RESUMABLE = (
    "resume",
    "total_frames",
    "max_minutes",
    "device",
    "threads",
    "log",
    "collect.processes",
)


def may_change(key: str) -> bool:
    """Return whether a key of the configuration, such as ``log.video``, may be changed."""
    return is_within(key, RESUMABLE)


def is_default(cfg: Any, key: str) -> bool:
    """Return whether a value of a configuration is that of a field that was not set.

    Args:
        cfg: Dataclasses, mappings and lists.
        key: Dotted path: ``playground.props.3.partition``.

    Returns:
        False for an entry of a mapping or a list, and for a field that has no default.
    """
    *path, name = key.split(".")
    owner = cfg
    for part in path:
        if is_dataclass(owner):
            owner = getattr(owner, part)
        else:
            owner = owner[int(part) if isinstance(owner, list) else part]
    if not is_dataclass(owner) or isinstance(owner, type):
        return False
    others = {f.name: getattr(owner, f.name) for f in fields(owner) if f.init and f.name != name}
    try:
        unset = type(owner)(**others)  # also a default that depends on the other fields
    except (TypeError, ValueError):
        return False
    return bool(getattr(unset, name) == getattr(owner, name))

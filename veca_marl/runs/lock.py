"""The lock on the folder of a run, and the refusal of links in it.

Only one process at a time writes to a folder: it holds a lock on the file `.lock`. The system
releases it when the process ends, however it ends, so that a run that was killed can be continued.
The file stays then, which has no meaning without the lock.
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import platform
import stat
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from veca_marl.algos.files import open_to_append, write_errors
from veca_marl.config import ConfigError

LOCK = ".lock"
_WAIT_S = 3.0  # worker processes hold the lock too; those of a killed run end within seconds
_RETRY_S = 0.1
_LONGEST = 300  # bytes: a process and the name of its machine
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
_LOG = logging.getLogger(__name__)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock on a folder, which is created, and removed at the end if it is empty.

    Raises:
        ConfigError: If another process holds it, or its file is something else than a lock.
        WriteError: If no file can be written there.
    """
    path = folder / LOCK
    try:
        with _acquire(path):
            try:
                yield
            finally:
                path.unlink(missing_ok=True)
    finally:
        remove_if_empty(folder)


def _acquire(path: Path) -> TextIO:
    """Return the open file that holds the lock."""
    deadline = time.monotonic() + _WAIT_S
    while True:
        with write_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            file = open_to_append(path, "a+")
        _check_ours(file)
        if _take(file) and _is_in_place(path, file):
            break
        holder = _holder(file)
        file.close()
        if time.monotonic() >= deadline:
            raise ConfigError(
                f"{path.parent} is in use: {holder} writes to it; "
                "wait until it has ended, or choose another folder"
            )
        time.sleep(_RETRY_S)
    with write_errors(path):
        file.truncate(0)
        file.write(f"{_HELD_BY.decode()}{os.getpid()} on {platform.node()}")
        file.flush()
    return file


_HELD_BY = b"process "


def _check_ours(file: TextIO) -> None:
    """Refuse to write to a file of the user that has the name of the lock.

    Raises:
        ConfigError: If it is no plain file, has a second name, or holds something else.
    """
    status = os.fstat(file.fileno())
    if not stat.S_ISREG(status.st_mode):
        reason = "no plain file"
    elif status.st_nlink > 1:
        reason = "a second name of another file"
    elif (begin := _start_of(file, len(_HELD_BY))) not in (b"", _HELD_BY):
        reason = f"a file that begins with {begin!r}"
    else:
        return
    file.close()
    raise ConfigError(f"{file.name} is {reason}, and no lock of a run: move it away")


def _start_of(file: TextIO, size: int) -> bytes:
    return os.pread(file.fileno(), size, 0)


def _take(file: TextIO) -> bool:
    """Return whether the lock could be taken, or its file system has no locks."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        _LOG.warning("%s cannot be locked: start no other run in its folder", file.name)
    return True


def _is_in_place(path: Path, file: TextIO) -> bool:
    """Return whether the file was not removed, by a run that ended, before its lock was taken."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def _holder(file: TextIO) -> str:
    """Return what the process that holds the lock wrote, in case it has already."""
    written = _start_of(file, _LONGEST).decode(errors="replace")
    return " ".join(written.split()) or "another process"


def remove_if_empty(path: Path) -> None:
    """Remove the folder of a run that could not be started."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()


_LOGGERS = ("wandb",)  # folders in which a logger makes links of its own


def check_links(folder: Path, names: Collection[str] | None = None) -> None:
    """Check that nothing that is written into the folder of a run goes elsewhere.

    The folder itself may be reached by a link: that one was given by the user. Loggers may have
    links in their folders, as long as they stay in them.

    Args:
        folder: The folder.
        names: Files and folders in it that are looked at; None for all.

    Raises:
        ConfigError: If there is a symbolic link; the message names the first one.
    """
    for name in sorted(os.listdir(folder)) if names is None else names:
        for path in _links(folder / name):
            of_logger = name in _LOGGERS and path != folder / name
            if not (of_logger and _leads_into(path, folder / name)):
                raise ConfigError(
                    f"{path} is a symbolic link: nothing is written into the folder of a run that "
                    "has links; put a copy in its place, or remove it"
                )


def _leads_into(link: Path, folder: Path) -> bool:
    return Path(os.path.realpath(link)).is_relative_to(os.path.realpath(folder))


def _links(path: Path) -> Iterator[Path]:
    """Yield the symbolic links at a path and below it, without following them."""
    if path.is_symlink():
        yield path
        return
    for parent, folders, files in os.walk(path):
        paths = (Path(parent, name) for name in sorted(folders + files))
        yield from filter(Path.is_symlink, paths)

"""The lock on a folder of results: only one process at a time writes to it.

The system releases it when the process ends, however it ends, so that a run that was killed can be
continued. The file stays then, which has no meaning without the lock.
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from veca_marl.algos.files import write_errors
from veca_marl.config import ConfigError

_FILE = ".lock"
_WAIT_S = 3.0  # worker processes hold the lock too; those of a killed run end within seconds
_RETRY_S = 0.1
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
_LOG = logging.getLogger(__name__)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock on a folder, which is created, and removed at the end if it is empty.

    Raises:
        ConfigError: If another process holds it.
        WriteError: If no file can be written there.
    """
    path = folder / _FILE
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
            file = path.open("a+")
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
        file.write(f"process {os.getpid()} on {platform.node()}")
        file.flush()
    return file


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
    file.seek(0)
    return file.read() or "another process"


def remove_if_empty(path: Path) -> None:
    """Remove the folder of a run that could not be started."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()

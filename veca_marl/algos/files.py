"""Files that are complete or absent, and errors that name the file and, if it is full, its disk."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

Content = bytes | memoryview
DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of the errors by which the system says that a file has no room."""


class WriteError(RuntimeError):
    """A file cannot be written; the message names it and the reason."""


def write_atomically(path: Path, content: Content | str) -> None:
    """Write a file so that it has either the new content or the old one, also after a power cut.

    The content goes to a temporary file beside it, which replaces it when it is on the disk.

    Args:
        path: The file; missing folders are created.
        content: Bytes, or text that is stored as UTF-8.

    Raises:
        WriteError: If it cannot be written; the file is unchanged, no temporary file is left.
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = temporary_of(path)
    with write_errors(path, len(data)):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        _sync_folder(path.parent)


def temporary_of(path: Path) -> Path:
    """Return the file that becomes `path` when it is complete; a killed process may leave it."""
    return path.with_name(f".{path.name}.tmp")


@contextmanager
def write_errors(path: Path, size: int = 0) -> Iterator[None]:
    """Raise `WriteError`, with the path and the space on a full disk, in place of `OSError`.

    Args:
        path: The file that is written inside the block.
        size: Bytes that are to be written, 0 if unknown.
    """
    try:
        yield
    except OSError as error:
        space = _space(path, size) if error.errno in DISK_FULL else ""
        raise WriteError(f"cannot write {path}: {error.strerror or error}{space}") from error


def _space(path: Path, size: int) -> str:
    """Return the free space where `path` is, or would be, beside that which is needed."""
    existing = next(folder for folder in path.absolute().parents if folder.is_dir())
    needed = f", {_megabytes(size)} needed" if size else ""
    return f" ({_megabytes(shutil.disk_usage(existing).free)} free{needed})"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:,.1f} MB"


def _sync_folder(folder: Path) -> None:
    """Let the new name of a file survive a power cut."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

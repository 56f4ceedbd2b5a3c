"""Files that are complete or absent, and errors that name the file and, if it is full, its disk.

Nothing is written through a symbolic link: a folder of unknown origin could lead to any file.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO, cast

Content = bytes | memoryview
DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of the errors by which the system says that a file has no room."""


class WriteError(RuntimeError):
    """A file cannot be written; the message names it and the reason."""


def write_atomically(path: Path, content: Content | str) -> None:
    """Write a file so that it has either the new content or the old one, also after a power cut.

    The content goes to a temporary file beside it, which replaces it when it is on the disk. A
    symbolic link is replaced; what it leads to stays as it is.

    Args:
        path: The file; missing folders are created.
        content: Bytes, or text that is stored as UTF-8.

    Raises:
        WriteError: If it cannot be written; the file is unchanged, no temporary file is left.
    """
    data = content.encode() if isinstance(content, str) else content
    with write_errors(path, len(data)):
        temporary = new_temporary(path)
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        _sync_folder(path.parent)


def new_temporary(path: Path) -> Path:
    """Create an empty file that becomes `path` when it is complete; a killed process may leave it.

    Its name cannot be foreseen, and it is created by this call, or the call fails: no file, and no
    link to one, can lie there before.

    Args:
        path: The file that is to be written; missing folders are created.

    Raises:
        OSError: If it cannot be created.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NOT_A_LINK, 0o666))
    return temporary


_NOT_A_LINK = getattr(os, "O_NOFOLLOW", 0)
_TEMPORARY = re.compile(r"\.(.+?)(\.[0-9a-f]{8})?\.tmp")  # of earlier versions without digits


def left_behind(folder: Path, names: re.Pattern[str]) -> list[Path]:
    """Return the temporary files that killed processes have left in a folder.

    Args:
        folder: The folder, which may be missing.
        names: Names of the files that were to be written.
    """
    if not folder.is_dir():
        return []
    files = [(_TEMPORARY.fullmatch(path.name), path) for path in sorted(folder.iterdir())]
    return [path for name, path in files if name and names.fullmatch(name.group(1))]


def open_to_append(path: Path, mode: str = "a") -> TextIO:
    """Open a text file itself, never what a symbolic link leads to, and without waiting for it.

    Args:
        path: The file, which is created if it is absent.
        mode: ``a``, or ``a+`` to read it too.

    Raises:
        OSError: If it is a symbolic link, or cannot be opened.
    """
    return cast(TextIO, open(path, mode, newline="", opener=_open_in_place))


def _open_in_place(path: str, flags: int) -> int:
    return os.open(path, flags | _NOT_A_LINK | getattr(os, "O_NONBLOCK", 0), 0o666)


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
        # the system's own words speak of too many levels
        is_link = error.errno == errno.ELOOP and path.is_symlink()
        reason = "it is a symbolic link" if is_link else error.strerror or error
        raise WriteError(f"cannot write {path}: {reason}{space}") from error


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

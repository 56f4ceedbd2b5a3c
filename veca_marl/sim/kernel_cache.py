"""The folder in which numba caches the compiled kernels, and a message while they are compiled.

numba invalidates a cached kernel when the file that defines it changes, but not when a function
that it calls in another file does, although that function is compiled into it. The cache folder
is therefore named by a digest of all sources of the simulator: changed sources use another folder.

The folder lies in the user's cache directory, never in the installed package, which may be
read-only or shared between users. The setting is numba's own and process-wide: kernels of other
packages that are defined after the import of the simulator are cached in the same folder, so that
kernels of plug-ins, which may contain functions of the simulator, are invalidated together with
them. A directory that the user has chosen (`NUMBA_CACHE_DIR`) is used as it is; it has to be
emptied by hand after an update.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.event import Event, Listener, register

KEPT_FOLDERS = 8
"""Caches of other versions of the sources that are kept; the least recently used are deleted."""

_LOG = logging.getLogger(__name__)
_DIGEST_CHARACTERS = 16
_CACHE_NAME = re.compile(f"[0-9a-f]{{{_DIGEST_CHARACTERS}}}")


def configure_kernel_cache(sources: Path) -> None:
    """Let numba cache kernels in a folder that belongs to the sources as they are now.

    Has to run before the first kernel is defined. Does nothing if a cache directory is set already.

    Args:
        sources: The folder of the sources that contain kernels or functions that kernels call.
    """
    config: Any = numba.config  # numba sets its attributes at run time
    if not config.CACHE_DIR:
        config.CACHE_DIR = str(_prepare_folder(source_digest(sources)))


def source_digest(sources: Path) -> str:
    """Return a digest of the names and the contents of all Python files below a folder."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(sources).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:_DIGEST_CHARACTERS]


def _prepare_folder(digest: str) -> Path:
    """Create the folder of a digest in the first directory that is writable, and mark it as used.

    Several processes may do this at once: each step succeeds also if another one did it before.
    """
    parents = [_user_cache() / "veca_marl" / "kernels", _temporary_cache()]
    for parent in parents:
        folder = parent / digest
        if _is_usable(folder):
            os.utime(folder)
            _delete_old_folders(parent)
            break
        _LOG.warning("cannot cache kernels in %s: not writable or owned by another user", folder)
    else:
        folder = Path(tempfile.mkdtemp(prefix="veca_marl-kernels-"))
    if folder.parent != parents[0]:
        _LOG.warning("compiled kernels are cached in %s; NUMBA_CACHE_DIR changes that", folder)
    return folder


def _user_cache() -> Path:
    """Return the user's cache directory (XDG Base Directory Specification)."""
    chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return chosen if chosen.is_absolute() else Path(os.path.expanduser("~")) / ".cache"


def _temporary_cache() -> Path:
    user = os.getuid() if hasattr(os, "getuid") else "user"
    return Path(tempfile.gettempdir()) / f"veca_marl-kernels-{user}"


def _is_usable(folder: Path) -> bool:
    """Create a folder if it is missing; return whether it is writable and belongs to this user.

    numba unpickles the files in its cache, so a folder that another user controls is not trusted.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        owners = {folder.stat().st_uid, folder.parent.stat().st_uid}
    except OSError:
        return False
    return not hasattr(os, "getuid") or owners == {os.getuid()}


def _delete_old_folders(parent: Path) -> None:
    """Delete the caches that were not used for longest, and nothing else that lies beside them."""
    caches = sorted(filter(_is_cache, parent.iterdir()), key=_last_use_s, reverse=True)
    for folder in caches[KEPT_FOLDERS:]:
        shutil.rmtree(folder, ignore_errors=True)


def _is_cache(folder: Path) -> bool:
    """Return whether a path has the name of a cache, and is a folder itself, not a link to one."""
    named = _CACHE_NAME.fullmatch(folder.name) is not None
    return named and folder.is_dir() and not folder.is_symlink()


def _last_use_s(folder: Path) -> float:
    try:
        return folder.lstat().st_mtime
    except OSError:  # another process has deleted it
        return 0.0


class CompilationNotice(Listener):
    """Writes one line when the first kernel of this package is compiled, not loaded from a cache.

    Args:
        write: Function that takes the line.
    """

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write
        self._is_written = False

    def on_start(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        module: str = event.data["dispatcher"].py_func.__module__
        if not self._is_written and module.startswith("veca_marl."):
            self._is_written = True
            self._write("compiling kernels (once; they are cached) ...")

    def on_end(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""


@cache
def announce_compilation() -> None:
    """Install the notice in this process; further calls have no effect.

    It listens to events of numba's compiler: calls of compiled kernels take no additional time.
    """
    register("numba:compile", CompilationNotice(_to_stderr))


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)

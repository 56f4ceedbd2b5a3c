"""The folders in which numba caches the compiled kernels.

numba invalidates a cached kernel when the file that defines it changes, but not when a function
that it calls in another file does, although that function is compiled into it. The kernels of each
file are therefore cached in a folder that is named by a digest of all sources that may be compiled
into them (`veca_marl.sim.kernel_sources`): changed sources use another folder, and copies of the
package with the same sources share one.

The folders lie in the user's cache directory, never in the installed package, which may be
read-only or shared between users, or in the directory that the user has chosen (`NUMBA_CACHE_DIR`).
The setting is numba's own and process-wide: kernels of other packages that are defined after the
import of the simulator are cached there too. Those of plug-ins may contain any function of the
package, so that their folders are named by a digest of all of it.

A cache is never fatal. numba reads its entries as they are: one that was cut off, by a full disk or
a crash, raises exceptions of pickle, or ends the process inside LLVM. Here each entry ends with a
digest of its content: what has another one is deleted and compiled again, and where nothing can be
written, kernels are compiled without a cache. Of processes that need the same kernel at once, one
compiles it and the others wait for it. For that, classes of `numba.core.caching` are extended; the
files stay such as numba reads them.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import logging
import os
import pickle
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO

import numba
from numba.core import dispatcher
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    IPythonCacheLocator,
    NullCache,
    UserProvidedCacheLocator,
)

from veca_marl.sim.kernel_sources import KernelSources

if sys.platform != "win32":
    import fcntl

KEPT_FOLDERS = 8
"""Caches of one file that are kept, of versions of the sources; the least recently used are
deleted."""

_LOG = logging.getLogger(__name__)
_DIGEST = "[0-9a-f]{16}"


def configure_kernel_cache(package: Path) -> None:
    """Let numba cache kernels in folders that belong to the sources as they are now.

    Has to run before the first kernel is defined. A cache directory that is set already stays.

    Args:
        package: The folder of the package that contains kernels or functions that kernels call.
    """
    config: Any = numba.config  # numba sets its attributes at run time
    user: Any = dispatcher
    user.FunctionCache = partial(_make_cache, KernelSources(package))
    if config.CACHE_DIR:
        return
    try:
        config.CACHE_DIR = str(_prepare_directory())
    except OSError as error:
        _report_uncached(str(error))
        config.CACHE_DIR = os.devnull  # no folder: nothing can be cached there


def _prepare_directory() -> Path:
    """Create the first directory for caches that is writable.

    Several processes may do this at once: each step succeeds also if another one did it before.
    """
    candidates = [_user_cache() / "veca_marl" / "kernels", _temporary_cache()]
    for directory in candidates:
        if _is_usable(directory):
            break
        _LOG.warning("cannot cache kernels in %s: not writable or owned by another user", directory)
    else:
        directory = Path(tempfile.mkdtemp(prefix="veca_marl-kernels-"))
    if directory != candidates[0]:
        _LOG.warning("compiled kernels are cached in %s; NUMBA_CACHE_DIR changes that", directory)
    return directory


def _user_cache() -> Path:
    """Return the user's cache directory (XDG Base Directory Specification)."""
    chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return chosen if chosen.is_absolute() else Path(os.path.expanduser("~")) / ".cache"


def _temporary_cache() -> Path:
    user = os.getuid() if hasattr(os, "getuid") else "user"
    return Path(tempfile.gettempdir()) / f"veca_marl-kernels-{user}" / "kernels"


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


def _delete_old_folders(used: Path) -> None:
    """Delete the caches of one file that were not used for longest, and nothing else beside them.

    Args:
        used: The folder that is used now.
    """
    module = used.name.rpartition("-")[0]
    named = re.compile(f"{re.escape(module)}-{_DIGEST}")
    folders = [p for p in used.parent.iterdir() if named.fullmatch(p.name) and _is_folder(p)]
    for folder in sorted(folders, key=_last_use_s, reverse=True)[KEPT_FOLDERS:]:
        shutil.rmtree(folder, ignore_errors=True)


def _is_folder(path: Path) -> bool:
    """Return whether a path is a folder itself, not a link to one."""
    return path.is_dir() and not path.is_symlink()


def _last_use_s(folder: Path) -> float:
    try:
        return folder.lstat().st_mtime
    except OSError:  # another process has deleted it
        return 0.0


@cache
def _report_uncached(reason: str) -> None:
    """Log once that kernels are compiled without a cache."""
    _LOG.warning("compiled kernels are not cached, each process compiles its own: %s", reason)


def _make_cache(sources: KernelSources, function: Any) -> Any:
    """Return the cache of a kernel: what numba calls in place of its `FunctionCache`.

    Where the folder cannot be written, a kernel is compiled without a cache.
    """
    try:
        return KernelCache(sources, function)
    except (OSError, RuntimeError):  # of numba: there is no folder that can be written
        config: Any = numba.config
        _report_uncached(f"{config.CACHE_DIR} cannot be written")
        return NullCache()


_Cache: Any = FunctionCache
_Files: Any = IndexDataCacheFile
_Contents: Any = CompileResultCacheImpl
_Locator: Any = UserProvidedCacheLocator


class SourceLocator(_Locator):  # type: ignore[misc]
    """Where a kernel is cached: in a folder that is named by the sources that it may contain.

    Args:
        sources: The sources of the package.
        function: The function that is compiled.
        file: The file that defines it.
    """

    def __init__(self, sources: KernelSources, function: Any, file: str) -> None:
        super().__init__(function, file)
        config: Any = numba.config
        if sources.contain(Path(file)):
            name = f"{sources.module(Path(file))}-{sources.digest(Path(file))}"
        else:
            name = f"{self.get_suitable_cache_subpath(file)}-{sources.digest_of_all()}"
        self._cache_path = os.path.join(config.CACHE_DIR, name)

    def ensure_cache_path(self) -> None:
        """Create the folder if it is missing, delete old ones then, and mark it as used."""
        folder = Path(self._cache_path)
        is_new = not folder.exists()
        super().ensure_cache_path()
        os.utime(folder)
        if is_new:
            _delete_old_folders(folder)


class SourceLocations:
    """Makes the locators of kernels that are defined in files, in place of a class of numba.

    Args:
        sources: The sources of the package.
    """

    def __init__(self, sources: KernelSources) -> None:
        self._sources = sources

    def from_function(self, function: Any, file: str) -> SourceLocator | None:
        """Return where a kernel is cached; None if it is in no file or nothing can be written."""
        if not os.path.exists(file):
            return None
        made = SourceLocator(self._sources, function, file)
        try:
            made.ensure_cache_path()
        except OSError:
            return None
        return made


class KernelContents(_Contents):  # type: ignore[misc]
    """What is stored of a kernel, and where. Kernels of notebooks are cached as by numba itself.

    Args:
        sources: The sources of the package.
        function: The function that is compiled.
    """

    def __init__(self, sources: KernelSources, function: Any) -> None:
        self._locator_classes = [SourceLocations(sources), IPythonCacheLocator]
        super().__init__(function)


class KernelCache(_Cache):  # type: ignore[misc]
    """The cache of one kernel, in which a damaged entry counts as none.

    Args:
        sources: The sources of the package.
        function: The function that is compiled.
    """

    def __init__(self, sources: KernelSources, function: Any) -> None:
        self._impl_class = partial(KernelContents, sources)
        super().__init__(function)
        self._cache_file = EntryFile(
            self.cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    @property
    def is_stored(self) -> bool:
        """Whether the cache has anything of this kernel."""
        return bool(self._cache_file.is_stored)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Store what was compiled, where there is room, and let waiting processes go on."""
        try:
            super().save_overload(signature, compiled)
        except OSError as error:
            _report_uncached(f"{error.strerror or error} ({self.cache_path})")
        finally:
            self._cache_file.end_turn()


class DamagedEntryError(Exception):
    """A file in the cache has another content than was written."""


_LONGEST_WAIT_S = 180.0  # a kernel is compiled within 30 s, on a machine that is busy as well
_POLL_S = 0.02
_DIGEST_BYTES = hashlib.sha256().digest_size


class EntryFile(_Files):  # type: ignore[misc]
    """The files of one kernel: an index of its signatures, and what was compiled for each.

    Each ends with a digest, which numba itself does not read.
    """

    @property
    def is_stored(self) -> bool:
        """Whether there is an index."""
        return os.path.exists(self._index_path)

    _turn: int | None = None  # the open file that holds the lock while this process compiles

    def load(self, key: Any) -> Any:
        """Return what is stored for a signature; None if this process is to compile it.

        Another process that compiles this kernel is waited for, unless it takes too long.
        """
        self.end_turn()
        stored = self._load_sound(key)
        if stored is None and self._wait_for_turn():
            stored = self._load_sound(key)
            if stored is not None:
                self.end_turn()
        return stored

    def save(self, key: Any, data: Any) -> None:
        """Store what was compiled for a signature.

        Raises:
            OSError: If it cannot be written.
        """
        try:
            super().save(key, data)
        except (DamagedEntryError, *_PICKLE_ERRORS) as error:
            self._discard(error)
            super().save(key, data)

    def _load_sound(self, key: Any) -> Any:
        try:
            return super().load(key)
        except (DamagedEntryError, *_PICKLE_ERRORS) as error:
            self._discard(error)
        except OSError as error:
            _report_uncached(str(error))
        return None

    def _load_index(self) -> Any:
        if not os.path.exists(self._index_path):
            return {}
        _check_digest(self._index_path)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        _check_digest(self._data_path(name))
        return super()._load_data(name)

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BinaryIO]:
        with super()._open_for_write(filepath) as file:
            content = io.BytesIO()
            yield content
            file.write(content.getvalue())
            file.write(hashlib.sha256(content.getvalue()).digest())

    def _discard(self, error: Exception) -> None:
        """Delete a damaged file; without its index, the others of the kernel are not read."""
        path = str(error) if isinstance(error, DamagedEntryError) else self._index_path
        _LOG.warning("a damaged entry of the cache of kernels is compiled again: %s", path)
        try:
            os.unlink(path)
        except OSError as reason:
            _report_uncached(str(reason))

    def _wait_for_turn(self) -> bool:
        """Return whether something may have been stored since: this process waited, or could."""
        try:
            turn = os.open(f"{self._index_path}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:  # what is compiled cannot be stored either, which is reported then
            return False
        deadline, waits = time.monotonic() + _LONGEST_WAIT_S, False
        while not (taken := _take(turn)) and time.monotonic() < deadline:
            if not waits:
                waits = True
                _tell_waiting()
            time.sleep(_POLL_S)
        if taken:
            self._turn = turn
        else:
            os.close(turn)
        return True

    def end_turn(self) -> None:
        """Let the next process compile this kernel; the system does so if this one dies."""
        if self._turn is not None:
            os.close(self._turn)
            self._turn = None


@cache
def _tell_waiting() -> None:
    """Say once that this process waits."""
    print("another process compiles kernels; waiting for it ...", file=sys.stderr)


_PICKLE_ERRORS = (
    pickle.UnpicklingError,
    EOFError,
    AttributeError,
    ImportError,
    LookupError,
    TypeError,
    ValueError,
)
"""What pickle raises for entries that were written by other versions."""


def take_lock(name: str) -> int | None:
    """Take a lock in the cache directory, without waiting.

    Args:
        name: Name of the lock.

    Returns:
        The descriptor of an open file, which child processes may inherit: the lock is held until
        all copies are closed. None if it is held already, or if nothing can be cached.
    """
    config: Any = numba.config
    try:
        lock = os.open(Path(config.CACHE_DIR, f"{name}.lock"), os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        return None
    if _take(lock):
        return lock
    os.close(lock)
    return None


def _check_digest(path: str) -> None:
    """Raise `DamagedEntryError`, with the path, if a file does not end with its digest.

    Raises:
        OSError: If it cannot be read.
    """
    content = Path(path).read_bytes()
    body, digest = content[:-_DIGEST_BYTES], content[-_DIGEST_BYTES:]
    if hashlib.sha256(body).digest() != digest:
        raise DamagedEntryError(path)


def _take(file: int) -> bool:
    """Return whether the lock was taken, or there are no locks here."""
    if sys.platform == "win32":
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks: each process compiles for itself
        return True
    return True

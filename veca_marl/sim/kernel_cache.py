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
import inspect
import io
import logging
import os
import pickle
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numba
from numba.core import dispatcher
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.event import Event, Listener, register

if sys.platform != "win32":
    import fcntl

KEPT_FOLDERS = 8
"""Caches of other versions of the sources that are kept; the least recently used are deleted."""

_LOG = logging.getLogger(__name__)
_DIGEST_CHARACTERS = 16
_CACHE_NAME = re.compile(f"[0-9a-f]{{{_DIGEST_CHARACTERS}}}")


def configure_kernel_cache(sources: Path) -> None:
    """Let numba cache kernels in a folder that belongs to the sources as they are now.

    Has to run before the first kernel is defined. A cache directory that is set already stays.

    Args:
        sources: The folder of the sources that contain kernels or functions that kernels call.
    """
    config: Any = numba.config  # numba sets its attributes at run time
    user: Any = dispatcher
    user.FunctionCache = _make_cache
    if config.CACHE_DIR:
        return
    try:
        config.CACHE_DIR = str(_prepare_folder(source_digest(sources)))
    except OSError as error:
        _report_uncached(str(error))
        config.CACHE_DIR = os.devnull  # no folder: nothing can be cached there


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


@cache
def _report_uncached(reason: str) -> None:
    """Log once that kernels are compiled without a cache."""
    _LOG.warning("compiled kernels are not cached, each process compiles its own: %s", reason)


def _make_cache(function: Any) -> Any:
    """Return the cache of a kernel: what numba calls in place of its `FunctionCache`.

    A kernel whose folder cannot be written has none: numba would go on to the folder of the
    sources, or end with an exception.
    """
    try:
        made = KernelCache(function)
    except (OSError, RuntimeError) as error:  # of numba: there is no folder that can be written
        _report_uncached(" ".join(str(error).split()))
        return NullCache()
    config: Any = numba.config
    in_a_file = os.path.exists(inspect.getfile(function))  # a cell of a notebook is in none
    if in_a_file and not Path(made.cache_path).is_relative_to(config.CACHE_DIR):
        _report_uncached(f"{config.CACHE_DIR} cannot be written")
        return NullCache()
    return made


_Cache: Any = FunctionCache
_Files: Any = IndexDataCacheFile


class KernelCache(_Cache):  # type: ignore[misc]
    """The cache of one kernel, in which a damaged entry counts as none.

    Args:
        function: The function that is compiled.
    """

    def __init__(self, function: Any) -> None:
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
_POLL_S = 0.1
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
                _to_stderr("another process compiles kernels; waiting for it ...")
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


_TOLD_EVERY_S = 10.0


class CompilationNotice(Listener):
    """Writes a line when the first kernel of this package is compiled, and then how many are left.

    Kernels that are loaded from the cache are not mentioned.

    Args:
        write: Function that takes a line.
        every_s: Time between two lines.
    """

    def __init__(self, write: Callable[[str], object], every_s: float = _TOLD_EVERY_S) -> None:
        self._write, self._every_s = write, every_s
        self._told_s: float | None = None
        self._depth, self._done = 0, 0  # kernels that call others compile these meanwhile
        self._begun_s = 0.0
        self._taken_s = 0.0

    def on_start(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        if not _is_ours(event):
            return
        if self._depth == 0:
            self._begun_s = time.process_time()
        self._depth += 1
        if self._told_s is None:
            self._told_s = time.monotonic()
            self._write(_FIRST_LINE)

    def on_end(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        if not _is_ours(event) or self._depth == 0:
            return
        self._depth -= 1
        self._done += 1
        if self._depth == 0:
            self._taken_s += time.process_time() - self._begun_s
        if self._told_s is not None and time.monotonic() - self._told_s >= self._every_s:
            self._told_s = time.monotonic()
            running_s = time.process_time() - self._begun_s if self._depth else 0.0
            self._write(
                f"compiling kernels: {self._done} done, at most {kernels_left()} left, "
                f"{self._taken_s + running_s:.0f} s of processor time"
            )


_FIRST_LINE = "compiling kernels (once; they are cached): about a minute of processor time ..."


def _is_ours(event: Event) -> bool:
    module: str = event.data["dispatcher"].py_func.__module__
    return module.startswith("veca_marl.")


def kernels_left() -> int:
    """Return how many kernels of the imported modules are neither compiled nor in the cache.

    A game needs a part of them only.
    """
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("veca_marl.")]
    named = {id(v): v for module in modules for v in vars(module).values()}
    kernels = [v for v in named.values() if isinstance(v, dispatcher.Dispatcher)]
    return sum(not kernel.overloads and not _is_stored(kernel) for kernel in kernels)


def _is_stored(kernel: Any) -> bool:
    """Return whether something is in the cache of a kernel, or nothing ever will be."""
    if kernel.targetoptions.get("inline") == "always":
        return True
    stored: Any = getattr(kernel, "_cache", None)
    return isinstance(stored, KernelCache) and stored.is_stored


@cache
def announce_compilation() -> None:
    """Install the notice in this process; further calls have no effect.

    It listens to events of numba's compiler: calls of compiled kernels take no additional time.
    """
    register("numba:compile", CompilationNotice(_to_stderr))


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)

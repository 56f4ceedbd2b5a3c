"""The file of a checkpoint: read without executing code, verified, and checked before it is used.

A checkpoint may be of unknown origin, or be damaged on a disk or on the way. `torch.load` reads
tensors and plain data only, but does not notice a changed bit: here the checksum (CRC-32) of each
record, which `torch.save` stores, is verified.
"""

from __future__ import annotations

import pickle
import re
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.specs import TeamSpec
from veca_marl.migrations import VersionError, migrated_checkpoint

# 3: actions have named parts, and each team an algorithm of its own
FORMAT = 3
_KEYS = {"identity", "config", "algorithms", "state"}
_CPU = torch.device("cpu")
# what zipfile and torch.load raise for files that are cut off or have other content
_UNREADABLE = (
    RuntimeError,
    EOFError,
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    zipfile.BadZipFile,
)
_DEEPEST = 50  # nested lists and mappings
_MOST_ENTRIES = 500_000
_MOST_PLAIN = 50_000  # of identity, configuration and numbers, beside the state


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written, read, or used here."""


def read_checkpoint(path: Path, device: torch.device) -> dict[str, Any]:
    """Return everything that is in the file of a checkpoint.

    Raises:
        CheckpointError: If it cannot be read, or is not a checkpoint of this version.
    """
    return checked_content(path, load_file(path, device))


Verify = Callable[[Any], None]
"""Raises `CheckpointError` if a tensor in an entry of a checkpoint has another checksum."""


def map_checkpoint(path: Path) -> tuple[dict[str, Any], Verify]:
    """Return what `read_checkpoint` returns; of its tensors, the disk is read when they are used.

    A replay buffer in a checkpoint thus takes neither memory nor time where only a network is
    wanted. The file has to stay as it is until the tensors have been copied.

    Returns:
        The content, and what has to be called with each entry of the state before it is used.

    Raises:
        CheckpointError: See `read_checkpoint`.
    """
    storages: list[torch.UntypedStorage] = []

    def keep(storage: Any, _: str) -> Any:
        storages.append(storage)
        return storage

    with _read_errors(path):
        records = _records(path, verified=lambda name: _RECORD.search(name) is None)
        if _is_utf8(path):
            content = torch.load(path, weights_only=True, map_location=keep, mmap=True)
        else:  # torch opens a mapped file by its name, in UTF-8 alone
            content = _load_open(path, keep)
        _check_entries(content)
    # torch.save numbers the storages in the order in which they occur, and so do we
    sums = {storage.data_ptr(): records.get(n) for n, storage in enumerate(storages)}

    def matches(storage: torch.UntypedStorage) -> bool:
        return not storage.nbytes() or sums.get(storage.data_ptr()) == _checksum(storage)

    def verify(entry: Any) -> None:
        for each in _entries(entry, _MOST_ENTRIES):
            if isinstance(each, torch.Tensor) and not matches(each.untyped_storage()):
                raise CheckpointError(f"cannot read {path}: {_DAMAGED}")

    return checked_content(path, content), verify


def load_file(path: Path, device: torch.device) -> Any:
    """Return the tensors and plain data in a file that `torch.save` wrote.

    Raises:
        CheckpointError: If it cannot be read.
    """
    with _read_errors(path):
        _records(path, verified=lambda _: True)
        content = _load_open(path, device)
        _check_entries(content)
    return content


def _is_utf8(path: Path) -> bool:
    """Return whether Python knows the characters of a name: not all, in an ASCII locale."""
    return not any("\udc80" <= character <= "\udcff" for character in str(path))


def _load_open(path: Path, map_location: Any) -> Any:
    with path.open("rb") as file:
        return torch.load(file, weights_only=True, map_location=map_location)


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Raise `CheckpointError` for what `zipfile` and `torch.load` raise."""
    try:
        yield
    except FileNotFoundError as error:
        raise CheckpointError(f"{path} does not exist") from error
    except pickle.UnpicklingError as error:
        # torch's own message says how to execute what is in it
        raise CheckpointError(
            f"cannot read {path}: it holds other objects than tensors, numbers and text"
        ) from error
    except (OSError, *_UNREADABLE) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise CheckpointError(f"cannot read {path} (cut off or no checkpoint): {reason}") from error


_DAMAGED = "the checksum of a record is another one; it was damaged"
_RECORD = re.compile(r"/data/(\d+)$", re.ASCII)  # of a storage, in the file of a checkpoint


def _records(path: Path, verified: Callable[[str], bool]) -> dict[int, int]:
    """Return the checksum of each storage in a file by its number, and verify some records.

    Args:
        path: The file.
        verified: Whether the record with a name is read and compared with its checksum.

    Raises:
        ValueError: If one differs, or is compressed: it could need more memory than there is.
        OSError: If the file cannot be read.
        Exception: Others of `_UNREADABLE`, of `zipfile`.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is no plain file")
    with zipfile.ZipFile(path) as archive:
        records = archive.infolist()
        if any(record.compress_type != zipfile.ZIP_STORED for record in records):
            raise ValueError("it is compressed")
        if sum(record.file_size for record in records) > status.st_size:
            raise ValueError("its records are larger than the file")
        for record in records:
            if verified(record.filename):
                _read_through(archive, record)
    numbers = [(_RECORD.search(record.filename), record.CRC) for record in records]
    return {int(number.group(1)): checksum for number, checksum in numbers if number}


def _read_through(archive: zipfile.ZipFile, record: zipfile.ZipInfo) -> None:
    """Read a record, without keeping it: `zipfile` compares its checksum at the end."""
    try:
        with archive.open(record) as file:
            while file.read(_BLOCK):
                pass
    except zipfile.BadZipFile as error:
        raise ValueError(_DAMAGED) from error


_BLOCK = 2**20  # bytes


def _checksum(storage: torch.UntypedStorage) -> int:
    content = torch.empty(0, dtype=torch.uint8).set_(storage)
    return zlib.crc32(content.numpy().data)


def _check_entries(content: Any) -> None:
    """Check that nothing in a file stands for more values than it has.

    Raises:
        ValueError: If an entry is a view with repeated elements, or there are too many.
    """
    for entry in _entries(content, _MOST_ENTRIES):
        if isinstance(entry, torch.Tensor) and _repeats(entry):
            raise ValueError(f"a tensor repeats its elements: {list(entry.shape)}")


def _repeats(tensor: torch.Tensor) -> bool:
    if tensor.layout != torch.strided:
        return False
    return tensor.numel() * tensor.element_size() > tensor.untyped_storage().nbytes()


def _entries(content: Any, most: int) -> Iterator[Any]:
    """Yield what is in nested lists and mappings, themselves too.

    Raises:
        ValueError: If there are more than `most` entries, or they are nested too deeply.
    """
    pending, found = [(content, 0)], 0
    while pending:
        entry, depth = pending.pop()
        found += 1
        if depth > _DEEPEST or found + len(pending) > most:
            raise ValueError("it has too many entries, or they are nested too deeply")
        yield entry
        if isinstance(entry, Mapping):
            pending += [(each, depth + 1) for each in entry.values()]
        elif isinstance(entry, list | tuple | set | frozenset):
            pending += [(each, depth + 1) for each in entry]


def checked_content(path: Path, content: Any) -> dict[str, Any]:
    """Return the content of a file, in the form of this version, if it is a checkpoint of it.

    Raises:
        CheckpointError: If it is none.
    """
    if not isinstance(content, dict) or "format" not in content:
        raise CheckpointError(f"{path} is not a checkpoint of a run")
    if content["format"] != FORMAT:
        raise CheckpointError(
            f"{path} has format {content['format']!r:.80}, this version reads format {FORMAT}"
        )
    missing = sorted(_KEYS - set(content))
    if missing:
        raise CheckpointError(f"{path} is incomplete: no {', '.join(missing)}")
    try:
        _check_parts(content)
        return migrated_checkpoint(content)
    except VersionError as error:
        raise CheckpointError(f"{path}: {error}") from error
    except ValueError as error:
        raise CheckpointError(f"{path} is damaged: {error}") from error


_PLAIN = (dict, list, tuple, str, int, float, type(None))


def _check_parts(content: Mapping[str, Any]) -> None:
    """Check the types of what every reader of a checkpoint uses.

    Raises:
        ValueError: If one is of another type; the message names it.
    """
    for part in sorted(_KEYS):
        if not isinstance(content[part], dict):
            raise ValueError(f"{part!r} is a {type(content[part]).__name__}, and no mapping")
        if part == "state":
            continue
        for entry in _entries(content[part], _MOST_PLAIN):
            if not isinstance(entry, _PLAIN):
                raise ValueError(f"{part!r} holds a {type(entry).__name__}")
            if isinstance(entry, dict) and not all(isinstance(key, str) for key in entry):
                raise ValueError(f"{part!r} has a key that is no text")
    identity, algorithms = content["identity"], content["algorithms"]
    if not isinstance(identity.get("task"), str) or not isinstance(identity.get("specs"), dict):
        raise ValueError("'identity' has no 'task' or no 'specs'")
    for team, spec in identity["specs"].items():
        try:
            TeamSpec.from_dict(spec)
        except ValueError as error:
            raise ValueError(f"'identity': specs of the team {team!r}: {error}") from error
    for team, numbers in algorithms.items():
        if not isinstance(numbers, dict) or not isinstance(numbers.get("name"), str):
            raise ValueError(f"'algorithms': that of the team {team!r} has no name")


@contextmanager
def load_errors(path: Path) -> Iterator[None]:
    """Raise `CheckpointError` where a state that is loaded inside the block does not fit."""
    try:
        yield
    except CheckpointError:
        raise
    except _UNREADABLE as error:
        reason = " ".join(str(error).split())
        raise CheckpointError(f"{path} does not fit: {type(error).__name__}: {reason}") from error

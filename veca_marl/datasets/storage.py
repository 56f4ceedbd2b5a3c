"""A stored data set: plain arrays in files, and a card that is written when all of them are.

The folder of a data set holds::

    card.json        fields, configuration, checksums; written last: without it nothing is read
    README.md        the same for people, with plots, sample pictures and sounds
    data/            a TensorDict as `TensorDict.memmap` writes it: meta.json, <field>.memmap
    plan.json        while it is made: what it is to become
    blocks/          while it is made: one file for each block of samples that is on the disk

Nothing is unpickled: the arrays are read by the sizes that the card states.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import MemoryMappedTensor, TensorDict
from torchrl.data import TensorDictReplayBuffer, TensorStorage
from torchrl.data.replay_buffers import ImmutableDatasetWriter, SamplerWithoutReplacement

from veca_marl.algos.files import write_atomically, write_errors
from veca_marl.datasets.fields import Field
from veca_marl.stored_files import StoredFileError, read_json

FORMAT = 1
"""Number of the form in which data sets are stored."""

BLOCK_BYTES = 8_000_000
_MOST_IN_BLOCK = 250
CARD, PLAN, DATA, BLOCKS = "card.json", "plan.json", "data", "blocks"
_READ_BYTES = 1 << 22


class DatasetError(ValueError):
    """A stored data set cannot be used; the message is one line."""


@dataclass(frozen=True)
class Plan:
    """What a data set is to become.

    Attributes:
        name: Name of the data set.
        n: Number of samples.
        seed: Seed of all samples.
        block: Samples of each block, the last one excepted.
        fields: The arrays of a sample.
        config: Its configuration as plain data.
        version: Version of veca_marl.
    """

    name: str
    n: int
    seed: int
    block: int
    fields: Mapping[str, Field]
    config: Mapping[str, Any]
    version: str

    @property
    def n_bytes(self) -> int:
        """Bytes of all arrays."""
        return self.n * sum(field.n_bytes for field in self.fields.values())

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return math.ceil(self.n / self.block)

    def rows(self, block: int) -> range:
        """Return the indices of the samples of a block."""
        return range(block * self.block, min((block + 1) * self.block, self.n))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "format": FORMAT,
            "name": self.name,
            "n": self.n,
            "seed": self.seed,
            "block": self.block,
            "fields": {name: field.to_dict() for name, field in self.fields.items()},
            "config": dict(self.config),
            "version": self.version,
        }

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any], path: Path) -> Plan:
        """Return the plan that `to_dict` was called on.

        Args:
            plain: Its content.
            path: The file it was read from.

        Raises:
            DatasetError: If it is something else, or of another format.
        """
        if plain.get("format") != FORMAT:
            raise DatasetError(
                f"{path} has the format {plain.get('format')!r:.40}; this version of veca_marl "
                f"reads format {FORMAT}: make the data set again"
            )
        try:
            numbers = {key: plain[key] for key in ("n", "seed", "block")}
            fields = {str(key): Field.from_dict(field) for key, field in plain["fields"].items()}
            named = [key for key in fields if not key.isidentifier()]
            wrong = [key for key, value in numbers.items() if type(value) is not int or value < 0]
            if named or wrong or not fields or numbers["n"] < 1 or numbers["block"] < 1:
                raise ValueError(f"impossible values of {[*named, *wrong] or 'n, block, fields'}")
            return cls(
                name=str(plain["name"]),
                fields=fields,
                config=dict(plain["config"]),
                version=str(plain["version"]),
                **numbers,
            )
        except (LookupError, TypeError, AttributeError, ValueError) as error:
            raise DatasetError(f"{path} does not describe a data set: {error}") from error


def block_size(sample_bytes: int) -> int:
    """Return the number of samples of a block: the unit that is lost when a process is killed."""
    return max(1, min(_MOST_IN_BLOCK, BLOCK_BYTES // max(sample_bytes, 1)))


def field_file(folder: Path, name: str) -> Path:
    """Return the file of a field in the folder of a data set."""
    return folder / DATA / f"{name}.memmap"


# ---- writing


def prepare_files(folder: Path, plan: Plan) -> None:
    """Make the files of all fields in their full length, and TensorDict's description of them.

    Raises:
        WriteError: If there is no room for them.
    """
    for name, field in plan.fields.items():
        path = field_file(folder, name)
        with write_errors(path, plan.n * field.n_bytes):
            path.parent.mkdir(parents=True, exist_ok=True)
            _refuse_link(path)
            with path.open("ab") as file:
                file.truncate(plan.n * field.n_bytes)
    write_atomically(folder / DATA / "meta.json", json.dumps(_tensordict_meta(plan)))


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise OSError(f"{path} is a symbolic link")


def _tensordict_meta(plan: Plan) -> dict[str, Any]:
    """Return the description that `TensorDict.load_memmap` reads."""
    meta: dict[str, Any] = {
        name: {
            "device": "cpu",
            "shape": [plan.n, *field.shape],
            "dtype": f"torch.{field.dtype}",
            "is_nested": False,
        }
        for name, field in plan.fields.items()
    }
    rest = {"shape": [plan.n], "device": "cpu", "_type": "<class 'tensordict._td.TensorDict'>"}
    return meta | rest


def write_block(
    folder: Path, plan: Plan, block: int, arrays: Mapping[str, NDArray[Any]]
) -> dict[str, str]:
    """Write the samples of a block to the disk; return the digest of each field.

    Args:
        folder: Folder of the data set, see `prepare_files`.
        plan: The plan.
        block: Number of the block.
        arrays: ``(samples, *shape)`` for each field.

    Raises:
        WriteError: If they cannot be written.
    """
    first, digests = plan.rows(block).start, {}
    for name, field in plan.fields.items():
        content = np.ascontiguousarray(arrays[name]).tobytes()
        path = field_file(folder, name)
        with write_errors(path, len(content)), path.open("r+b") as file:
            file.seek(first * field.n_bytes)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        digests[name] = hashlib.sha256(content).hexdigest()
    return digests


def record_block(folder: Path, block: int, digests: Mapping[str, str]) -> None:
    """Record that a block is on the disk."""
    write_atomically(folder / BLOCKS / f"{block:06}.json", json.dumps(dict(digests)))


def recorded_blocks(folder: Path, plan: Plan) -> dict[int, dict[str, str]]:
    """Return the digests of the blocks that are on the disk; damaged records do not count."""
    found: dict[int, dict[str, str]] = {}
    for block in range(plan.blocks):
        path = folder / BLOCKS / f"{block:06}.json"
        if path.is_file():
            try:
                digests = read_json(path)
            except StoredFileError:
                continue
            if digests.keys() == plan.fields.keys():
                found[block] = {name: str(value) for name, value in digests.items()}
    return found


def checksum_of(blocks: list[dict[str, str]]) -> str:
    """Return the digest of a whole data set from those of its blocks."""
    text = json.dumps(blocks, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def finish(folder: Path, card: Mapping[str, Any]) -> None:
    """Write the card, which makes the data set complete, and delete what was for its making."""
    write_atomically(folder / CARD, json.dumps(card, indent=1) + "\n")
    (folder / PLAN).unlink(missing_ok=True)
    shutil.rmtree(folder / BLOCKS, ignore_errors=True)


# ---- reading


@dataclass(frozen=True)
class StoredDataset:
    """A complete data set.

    Attributes:
        folder: Where it is.
        plan: What it is.
        card: The whole content of its card.
        data: ``[n]``: the fields, mapped from the disk; do not write into them.
    """

    folder: Path
    plan: Plan
    card: Mapping[str, Any]
    data: TensorDict

    def __len__(self) -> int:
        return self.plan.n

    def names(self, role: str) -> list[str]:
        """Return the names of the fields of a role: input, label or extra."""
        return [name for name, field in self.plan.fields.items() if field.role.value == role]

    def verify(self) -> None:
        """Read everything and compare it with the checksums of the card.

        Raises:
            DatasetError: If a block was altered; the message names it.
        """
        blocks = self.card.get("blocks")
        fields = self.plan.fields
        if not isinstance(blocks, list) or len(blocks) != self.plan.blocks:
            raise DatasetError(f"{self.folder / CARD} has no checksums of the blocks")
        if checksum_of(blocks) != self.card.get("checksum"):
            raise DatasetError(f"{self.folder / CARD} was altered: its checksums do not agree")
        for name in fields:
            for block, digests in enumerate(blocks):
                if self._digest(name, block) != digests.get(name):
                    rows = self.plan.rows(block)
                    raise DatasetError(
                        f"{field_file(self.folder, name)} was altered: samples {rows.start} to "
                        f"{rows.stop - 1} differ from the checksum in {CARD}"
                    )

    def _digest(self, name: str, block: int) -> str:
        rows, size = self.plan.rows(block), self.plan.fields[name].n_bytes
        digest = hashlib.sha256()
        with field_file(self.folder, name).open("rb") as file:
            file.seek(rows.start * size)
            left = len(rows) * size
            while left > 0 and (content := file.read(min(left, _READ_BYTES))):
                digest.update(content)
                left -= len(content)
        return digest.hexdigest()


def load(folder: str | Path, verify: bool = False) -> StoredDataset:
    """Read a data set; its arrays are mapped from the disk, and read when they are used.

    Args:
        folder: Its folder.
        verify: Whether to read all of it and compare it with its checksums.

    Raises:
        DatasetError: If there is none, it is not complete, or it was truncated or altered.
    """
    folder = Path(folder)
    card = _read_card(folder)
    plan = Plan.from_dict(card, folder / CARD)
    data = TensorDict(
        {name: _mapped(folder, plan, name, field) for name, field in plan.fields.items()},
        batch_size=[plan.n],
    )
    stored = StoredDataset(folder, plan, card, data)
    if verify:
        stored.verify()
    return stored


def _read_card(folder: Path) -> dict[str, Any]:
    if not folder.is_dir():
        raise DatasetError(f"{folder} is no folder of a data set; make one with `datasets make`")
    if not (folder / CARD).exists():
        if (folder / PLAN).exists():
            raise DatasetError(f"{folder} is not complete: the same `make` command continues it")
        raise DatasetError(f"{folder} holds no data set: it has no {CARD}")
    try:
        return read_json(folder / CARD)
    except StoredFileError as error:
        raise DatasetError(str(error)) from error


def _mapped(folder: Path, plan: Plan, name: str, field: Field) -> torch.Tensor:
    path, size = field_file(folder, name), plan.n * field.n_bytes
    try:
        status = os.lstat(path)
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror}") from error
    if not stat.S_ISREG(status.st_mode):
        raise DatasetError(f"{path} is no plain file")
    if status.st_size != size:
        raise DatasetError(
            f"{path} has {status.st_size} bytes, not {size}: it was truncated or altered"
        )
    mapped: torch.Tensor = MemoryMappedTensor.from_filename(
        path, dtype=getattr(torch, field.dtype), shape=torch.Size([plan.n, *field.shape])
    )
    return mapped


def replay_buffer(data: TensorDict, batch_size: int) -> TensorDictReplayBuffer:
    """Return a data set, or a part of it, as the offline data sets of `torchrl.data` are read.

    Each sample is drawn once before any is drawn again; nothing can be written.

    Args:
        data: ``[n]``, such as `StoredDataset.data`.
        batch_size: Samples of each draw.
    """
    return TensorDictReplayBuffer(
        storage=TensorStorage(data),
        sampler=SamplerWithoutReplacement(),
        writer=ImmutableDatasetWriter(),
        batch_size=batch_size,
    )

"""The bytes of demonstrations: one episode in files of its own, and appended to all others."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import MemoryMappedTensor, TensorDict, TensorDictBase

from veca_marl.algos.demonstration_files import (
    CARD,
    DATA,
    END,
    INDEX,
    OUTCOME,
    STATE,
    Array,
    Card,
    DemonstrationsError,
    Episode,
    read_index,
)
from veca_marl.algos.files import open_to_append, write_atomically, write_errors

PARTS = ".parts"
"""Folder of episodes that are recorded and not yet appended."""
_BUFFER = 2**20  # bytes
_BLOCK = 2**22  # bytes


class EpisodeWriter:
    """Writes the rows of one episode, each array into a file of its own.

    Args:
        folder: Folder of the files, which is created; what it holds is replaced.
        arrays: The arrays of a row.
    """

    def __init__(self, folder: Path, arrays: Sequence[Array]) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self._folder, self._arrays, self._rows = folder, arrays, 0
        self._open = ExitStack()
        self._files = [
            self._open.enter_context(_part(folder, i).open("wb", _BUFFER))
            for i in range(len(arrays))
        ]

    def add(self, step: TensorDictBase) -> None:
        """Add a step of an environment of one world, with its action and what followed."""
        following = step["next"]
        for file, array in zip(self._files, self._arrays, strict=True):
            if array.key == (END,):
                file.write(b"\0")
                continue
            source = following if array.role == OUTCOME else step
            file.write(_bytes(source[array.key], array))
        self._rows += 1

    def end(self, state: TensorDictBase) -> str:
        """Add the observation after the last step, close the files and return the digest.

        Args:
            state: The ``next`` of the last step.
        """
        for file, array in zip(self._files, self._arrays, strict=True):
            if array.key == (END,):
                file.write(b"\1")
            elif array.role == STATE:
                file.write(_bytes(state[array.key], array))
            else:
                file.write(bytes(array.row_bytes))
        self._open.close()
        total = hashlib.sha256()
        for i in range(len(self._arrays)):
            with open(_part(self._folder, i), "rb") as file:
                while block := file.read(_BLOCK):
                    total.update(block)
        return total.hexdigest()

    @property
    def steps(self) -> int:
        """Steps that were added."""
        return self._rows


def _part(folder: Path, number: int) -> Path:
    return folder / f"{number:04}.part"


def _bytes(tensor: torch.Tensor, array: Array) -> bytes:
    """Return the bytes of one row; the batch has one world."""
    row: NDArray[Any] = tensor[0].numpy(force=True)
    if row.shape != array.shape or row.dtype != np.dtype(array.dtype):
        raise ValueError(
            f"{'/'.join(array.key)} is {row.dtype} {row.shape}, not {array.dtype} {array.shape}"
        )
    return np.ascontiguousarray(row).tobytes()


class Archive:
    """A folder of demonstrations that is being recorded.

    Episodes are appended in their order. What a process that is killed leaves is removed: the index
    names the rows that count.

    Args:
        folder: The folder.
        card: What is recorded.

    Attributes:
        episodes: The episodes that are stored.

    Raises:
        DemonstrationsError: If the folder holds other demonstrations, or more of them.
    """

    def __init__(self, folder: Path, card: Card) -> None:
        self.folder, self._card = folder, card
        if (folder / CARD).exists():
            _check_same(folder, Card.read(folder), card)
        self.episodes: list[Episode] = read_index(folder)
        if len(self.episodes) > card.episodes:
            raise DemonstrationsError(
                f"{folder} holds {len(self.episodes)} episodes already; episodes={card.episodes} "
                "is fewer"
            )

    @property
    def complete(self) -> bool:
        """Whether all episodes are stored."""
        return len(self.episodes) == self._card.episodes

    @property
    def _rows(self) -> int:
        return sum(episode.steps + 1 for episode in self.episodes)

    def begin(self) -> None:
        """Write the card of what is not complete, and remove what does not count."""
        write_atomically(self.folder / CARD, self._card.text)
        shutil.rmtree(self.folder / PARTS, ignore_errors=True)
        with write_errors(self.folder):
            for array in self._card.arrays:
                path = array.file(self.folder)
                path.parent.mkdir(parents=True, exist_ok=True)
                size = path.stat().st_size if path.exists() else 0
                if size < self._rows * array.row_bytes:
                    raise DemonstrationsError(
                        f"{path} has {size} bytes, too few for {len(self.episodes)} episodes; "
                        "record into another folder"
                    )
                if size > self._rows * array.row_bytes:
                    os.truncate(path, self._rows * array.row_bytes)
            index = "".join(episode.line for episode in self.episodes)
        write_atomically(self.folder / INDEX, index)

    def part(self, number: int) -> Path:
        """Return the folder for the files of an episode."""
        return self.folder / PARTS / f"{number:06}"

    def append(self, episode: Episode) -> None:
        """Append the next episode, whose files are complete, and remove these files."""
        part = self.part(len(self.episodes))
        stored = replace(episode, first=self._rows)
        for number, array in enumerate(self._card.arrays):
            path = array.file(self.folder)
            with write_errors(path), ExitStack() as files:
                source = files.enter_context(open(_part(part, number), "rb"))
                target = files.enter_context(open(path, "ab"))
                shutil.copyfileobj(source, target, _BLOCK)
                target.flush()
                os.fsync(target.fileno())
        with write_errors(self.folder / INDEX), open_to_append(self.folder / INDEX) as index:
            index.write(stored.line)
            index.flush()
            os.fsync(index.fileno())
        self.episodes.append(stored)
        shutil.rmtree(part)

    def finish(self, summary: dict[str, Any]) -> Card:
        """Describe the data as `TensorDict.load_memmap` reads them, and complete the card."""
        shutil.rmtree(self.folder / PARTS, ignore_errors=True)
        with write_errors(self.folder / DATA):
            _describe(self.folder, self._card.arrays, self._rows)
        content = (self.folder / INDEX).read_bytes()
        more = {**self._card.more, "summary": summary}
        checksum = hashlib.sha256(content).hexdigest()
        self._card = replace(self._card, complete=True, checksum=checksum, more=more)
        write_atomically(self.folder / CARD, self._card.text)
        return self._card


def _check_same(folder: Path, stored: Card, card: Card) -> None:
    """Raise `DemonstrationsError` if other episodes are recorded in a folder."""
    pairs = {
        "task": (stored.task, card.task),
        "seed": (stored.seed, card.seed),
        "game": (stored.more.get("game"), card.more["game"]),
        "arrays": (stored.arrays, card.arrays),
    }
    differing = [name for name, (before, now) in pairs.items() if before != now]
    if differing:
        name = differing[0]
        before, now = pairs[name]
        shown = f" ({before!s:.40}, not {now!s:.40})" if name in ("task", "seed") else ""
        raise DemonstrationsError(
            f"{folder} holds demonstrations of another {name}{shown}; choose another folder"
        )


def _describe(folder: Path, arrays: Sequence[Array], rows: int) -> None:
    """Write the files by which TensorDict knows the shapes and types of the arrays."""
    described = TensorDict({}, [rows])
    for array in arrays:
        shape = torch.Size([rows, *array.shape])
        described[array.key] = MemoryMappedTensor.from_filename(
            str(array.file(folder)), dtype=getattr(torch, array.dtype), shape=shape
        )
    described.memmap_(prefix=str(folder / DATA), copy_existing=True)

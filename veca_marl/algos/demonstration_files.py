"""The files of demonstrations: a card, an index and the rows of one memory-mapped TensorDict.

A folder of demonstrations holds::

    card.json        what was recorded, by what and how: see `Card`
    episodes.jsonl   one line for each episode: its rows, its returns, the digest of its bytes
    data/            a TensorDict of rows, written as by `TensorDict.memmap`

The rows of an episode follow each other. A row holds what a team observed before a step, its
action and what the step gave: reward, flags, reward terms. An episode of T steps has T + 1 rows:
the last one, with `END`, holds the observation after its last step, and zeros for everything else.
Each observation is stored once.

Files are data: nothing is unpickled, and paths are made of names that were checked.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from veca_marl.algos.specs import TeamSpec
from veca_marl.stored_files import StoredFileError, read_bytes, read_json

CARD, INDEX, DATA = "card.json", "episodes.jsonl", "data"
KIND, FORMAT = "veca_marl demonstrations", 1
END = "end"
"""Key of the flag of rows that hold what follows the last step of an episode."""

STATE, ACTION, OUTCOME = "state", "action", "outcome"
"""Roles of arrays (before a step, the action, and what the step gave)."""

_DTYPES = ("uint8", "bool", "int64", "int32", "float32", "float64")
_NAME = re.compile(r"\w[\w.-]{0,99}")
_LARGEST_INDEX = 200_000_000  # bytes

Key = tuple[str, ...]


class DemonstrationsError(ValueError):
    """Demonstrations cannot be used; the message is one line with the folder and the reason."""


@dataclass(frozen=True)
class Array:
    """One array of the rows.

    Attributes:
        key: Its key in the TensorDict of rows.
        shape: Its shape in one row.
        dtype: Name of its torch type.
        role: `STATE`, `ACTION` or `OUTCOME`.
    """

    key: Key
    shape: tuple[int, ...]
    dtype: str
    role: str

    @property
    def row_bytes(self) -> int:
        """Bytes of one row."""
        return math.prod(self.shape) * int(getattr(torch, self.dtype).itemsize)

    def file(self, folder: Path) -> Path:
        """Return its file in the folder of demonstrations."""
        return folder.joinpath(DATA, *self.key[:-1], f"{self.key[-1]}.memmap")

    def to_dict(self) -> dict[str, Any]:
        """Return what the card says of it."""
        return {
            "key": list(self.key),
            "shape": list(self.shape),
            "dtype": self.dtype,
            "role": self.role,
        }

    @classmethod
    def from_dict(cls, plain: Any) -> Array:
        """Return what `to_dict` was called on.

        Raises:
            ValueError: If it is something else, or no array that can be stored.
        """
        if not isinstance(plain, dict):
            raise ValueError("an array is no mapping")
        key, shape = plain.get("key"), plain.get("shape")
        if not isinstance(key, list) or not key or not all(_is_name(part) for part in key):
            raise ValueError(f"{key!r:.80} is no key of an array")
        if not isinstance(shape, list) or not all(_is_count(length) for length in shape):
            raise ValueError(f"{shape!r:.80} is no shape")
        dtype, role = plain.get("dtype"), plain.get("role")
        if dtype not in _DTYPES or role not in (STATE, ACTION, OUTCOME):
            raise ValueError(f"{dtype!r:.40} {role!r:.40} is no type and role of an array")
        return cls(tuple(key), tuple(shape), dtype, role)


@dataclass(frozen=True)
class Episode:
    """One recorded episode.

    Attributes:
        first: Its first row.
        steps: Its steps; it has a row more.
        digest: SHA-256 of its bytes, array after array in the order of the card.
        returns: Undiscounted sum of rewards by team, the mean over its agents.
        solved: Fraction of the agents of a team with the goal reached at the end; empty for a task
            without a goal.
    """

    first: int
    steps: int
    digest: str
    returns: dict[str, float]
    solved: dict[str, float]

    @property
    def line(self) -> str:
        """Its line in the index."""
        return json.dumps(vars(self)) + "\n"

    @classmethod
    def from_line(cls, text: str) -> Episode:
        """Return the episode of a line.

        Raises:
            ValueError: If the line has other content.
        """
        plain = json.loads(text)
        if not isinstance(plain, dict) or plain.keys() != cls.__dataclass_fields__.keys():
            raise ValueError("a line is no episode")
        counts = (plain["first"], plain["steps"])
        if not all(map(_is_count, counts)) or plain["steps"] == 0:
            raise ValueError(f"rows {counts!r:.80} are no rows of an episode")
        if not all(_is_scores(plain[name]) for name in ("returns", "solved")):
            raise ValueError("an episode has no returns")
        if not isinstance(plain["digest"], str):
            raise ValueError("an episode has no digest")
        return cls(**plain)


@dataclass(frozen=True)
class TeamForm:
    """What demonstrations have to have in common with what learns from them.

    Attributes:
        spec: The arrays of the team.
        body: Name and numbers of its bodies.
        senses: Numbers of its senses, by name.
    """

    spec: TeamSpec
    body: dict[str, Any]
    senses: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data of JSON; infinite numbers are texts."""
        spec = plain_json(self.spec.to_dict())
        return {"spec": spec, "body": plain_json(self.body), "senses": plain_json(self.senses)}

    @classmethod
    def from_dict(cls, plain: Any) -> TeamForm:
        """Return what `to_dict` was called on.

        Raises:
            ValueError: If it is something else.
        """
        if not isinstance(plain, dict) or not all(
            isinstance(plain.get(name), dict) for name in ("spec", "body", "senses")
        ):
            raise ValueError("a team has no spec, body and senses")
        spec = TeamSpec.from_dict(_with_numbers(plain["spec"]))
        return cls(spec, plain["body"], plain["senses"])

    def differences(self, other: TeamForm) -> list[str]:
        """Return in words how the other one differs; empty if it does not."""
        return [
            f"{name} is {before!s:.60} there, {now!s:.60} here"
            for name, before, now in _differing(self.to_dict(), other.to_dict())
        ]


@dataclass(frozen=True)
class Card:
    """What the file ``card.json`` says.

    Attributes:
        task: Name of the task.
        seed: Seed of the episodes; episode n is episode 0 of world n.
        episodes: Number of episodes that were asked for.
        complete: Whether all of them are stored.
        control_rate_hz: Agent steps per second.
        teams: Team to its form.
        arrays: The arrays of the rows, in the order of the digests.
        checksum: SHA-256 of the index, which holds the digests of the episodes; empty before all
            are stored.
        more: What is for readers: ``game``, ``provenance``, ``summary``.
    """

    task: str
    seed: int
    episodes: int
    complete: bool
    control_rate_hz: int
    teams: dict[str, TeamForm]
    arrays: tuple[Array, ...]
    checksum: str
    more: dict[str, Any]

    @property
    def text(self) -> str:
        """The content of the file."""
        plain = {
            "kind": KIND,
            "format": FORMAT,
            **{name: value for name, value in vars(self).items() if name != "more"},
            "teams": {team: form.to_dict() for team, form in self.teams.items()},
            "arrays": [array.to_dict() for array in self.arrays],
            **plain_json(self.more),
        }
        return json.dumps(plain, indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, folder: Path) -> Card:
        """Return the card of a folder.

        Raises:
            DemonstrationsError: If there is none, or it is of another format.
        """
        path = folder / CARD
        if not path.is_file():
            raise DemonstrationsError(f"{folder} holds no demonstrations (no {CARD})")
        try:
            plain = read_json(path)
        except StoredFileError as error:
            raise DemonstrationsError(str(error)) from error
        if plain.pop("kind", None) != KIND:
            raise DemonstrationsError(f"{path} is no card of demonstrations")
        if (number := plain.pop("format", None)) != FORMAT:
            raise DemonstrationsError(
                f"{path} has the format {number!r:.40}; this version reads {FORMAT}"
            )
        try:
            return cls._from_plain(plain)
        except (LookupError, TypeError, AttributeError, ValueError) as error:
            raise DemonstrationsError(f"{path} is damaged: {' '.join(str(error).split())}") from (
                error
            )

    @classmethod
    def _from_plain(cls, plain: dict[str, Any]) -> Card:
        known = {name: plain.pop(name) for name in cls.__dataclass_fields__ if name != "more"}
        types = {"task": str, "complete": bool, "checksum": str, "teams": dict, "arrays": list}
        for name, kind in types.items():
            if not isinstance(known[name], kind):
                raise ValueError(f"{name}={known[name]!r:.80}")
        for name in ("seed", "episodes", "control_rate_hz"):
            if not _is_count(known[name]):
                raise ValueError(f"{name}={known[name]!r:.80}")
        known["teams"] = {team: TeamForm.from_dict(form) for team, form in known["teams"].items()}
        known["arrays"] = tuple(Array.from_dict(array) for array in known["arrays"])
        return cls(**known, more=plain)


def read_index(folder: Path) -> list[Episode]:
    """Return the episodes that are stored in a folder, in their order.

    A last line without an end, as a process leaves it that was killed while it wrote, is left out.

    Raises:
        DemonstrationsError: If the index is damaged.
    """
    return episodes_of(folder / INDEX, index_bytes(folder / INDEX))


def index_bytes(path: Path) -> bytes:
    """Return the content of an index; nothing if there is no such file.

    Raises:
        DemonstrationsError: If it cannot be read.
    """
    if not path.is_file():
        return b""
    try:
        return read_bytes(path, _LARGEST_INDEX)
    except StoredFileError as error:
        raise DemonstrationsError(str(error)) from error


def episodes_of(path: Path, content: bytes) -> list[Episode]:
    """Return the episodes of an index with some content, see `read_index`."""
    whole = content[: content.rfind(b"\n") + 1]
    try:
        episodes = [Episode.from_line(line) for line in whole.decode().splitlines()]
    except (ValueError, RecursionError) as error:
        raise DemonstrationsError(f"{path} is damaged: {' '.join(str(error).split())}") from error
    row = 0
    for episode in episodes:
        if episode.first != row:
            raise DemonstrationsError(f"{path} is damaged: no episode begins in row {row}")
        row += episode.steps + 1
    return episodes


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and _NAME.fullmatch(value) is not None


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**62


def _is_scores(value: Any) -> bool:
    return isinstance(value, dict) and all(type(one) in (int, float) for one in value.values())


def plain_json(value: Any) -> Any:
    """Return plain data with texts in place of infinite numbers, which JSON does not have."""
    if isinstance(value, Mapping):
        return {str(name): plain_json(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def _with_numbers(value: Any) -> Any:
    """Return plain data with infinite numbers in place of the texts of `plain_json`."""
    if isinstance(value, dict):
        return {name: _with_numbers(one) for name, one in value.items()}
    return float(value) if value in ("inf", "-inf") else value


def _differing(one: Any, other: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted key and both values wherever two plain values differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in {**one, **other}:
            dotted = f"{name}.{key}".lstrip(".")
            yield from _differing(one.get(key, "absent"), other.get(key, "absent"), dotted)
    elif one != other:
        yield name, one, other

"""Messages between client and server: versioned, within limits, and checked before use.

A message has two or three frames: `MARK`, a header in msgpack (kind, number, fields), and the raw
bytes of arrays. The number connects an answer with its request. Whoever reads a message believes
nothing: a header is limited in size, depth and types, and the size of the arrays is compared with
that which the specs give (`layouts`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import msgpack

PROTOCOL = 2
"""Number of this form of messages; a peer with another one is refused."""
_NAME = b"veca_marl "
MARK = _NAME + str(PROTOCOL).encode()
"""First frame of each message."""

LARGEST_REQUEST_HEADER = 64_000
"""Bytes of the header of a request."""
LARGEST_ANSWER_HEADER = 1_000_000
"""Bytes of the header of an answer; that to `hello` has the specs and the configuration."""
_MOST_ENTRIES = 20_000  # of a list or mapping
_LARGEST_NUMBER = 2**53

HELLO, OPEN, RESET, STEP, STATE, VIEW, CLOSE = (
    "hello",
    "open",
    "reset",
    "step",
    "state",
    "view",
    "close",
)
"""Kinds of requests, for specs, worlds, episodes, steps, the state, a picture, and the end."""
REQUESTS = (HELLO, OPEN, RESET, STEP, STATE, VIEW, CLOSE)
DONE, PART, REFUSED, WORKING, PROBE = "done", "part", "refused", "working", "probe"
"""Kinds of answers, which are a result or the last part of one, another part of it, an error, that
there is work on it, and nothing."""
PART_NUMBER = "part"
"""Field with the number of a part of a result; without it, the result has one part."""

ACTION, CALL, ENDED, PEER = "action", "call", "ended", "peer"
"""Reasons of refusals, which are an invalid action, a call at the wrong time, worlds that are no
longer there, and a peer that is not served."""


class ProtocolError(ValueError):
    """A message is not one of this protocol, or of a peer of another version."""


@dataclass(frozen=True)
class Message:
    """A message.

    Attributes:
        kind: What it asks for, or what kind of answer it is.
        number: Number of the request.
        fields: Its values by name; only what msgpack has: text, numbers, bytes, lists, mappings.
        data: Raw bytes of arrays; empty if there are none.
    """

    kind: str
    number: int = 0
    fields: dict[str, Any] = field(default_factory=dict)
    data: Any = b""

    def parts(self) -> tuple[bytes, Any]:
        """Return the header and the arrays."""
        return msgpack.packb([self.kind, self.number, self.fields]), self.data

    def frames(self) -> list[Any]:
        """Return the frames of the message."""
        return as_frames(*self.parts())


def as_frames(header: Any, data: Any) -> list[Any]:
    """Return a header and arrays as the frames of a message."""
    return [MARK, header, data] if len(data) else [MARK, header]


def decode(frames: Sequence[Any], largest_header: int) -> Message:
    """Return the message in some frames.

    Args:
        frames: Buffers.
        largest_header: Bytes that the header may have.

    Raises:
        ProtocolError: If they are none of this protocol.
    """
    check_mark(frames)
    if len(frames) not in (2, 3):
        raise ProtocolError(f"a message has {len(frames)} frames, not 2 or 3")
    return decode_parts(frames[1], frames[2] if len(frames) == 3 else b"", largest_header)


def decode_parts(header: Any, data: Any, largest_header: int) -> Message:
    """Return the message with a header and arrays; see `decode`."""
    if len(header) > largest_header:
        raise ProtocolError(f"a header has {len(header)} bytes; at most {largest_header} are read")
    try:
        content = msgpack.unpackb(
            header,
            strict_map_key=True,
            max_str_len=largest_header,
            max_bin_len=largest_header,
            max_array_len=_MOST_ENTRIES,
            max_map_len=_MOST_ENTRIES,
            max_ext_len=0,
        )
    except (ValueError, RecursionError, msgpack.UnpackException) as error:
        raise ProtocolError(f"a header is no msgpack: {type(error).__name__}") from None
    if not isinstance(content, list) or len(content) != 3:
        raise ProtocolError("a header is no list of kind, number and fields")
    kind, number, fields = content
    if type(kind) is not str or type(number) is not int or type(fields) is not dict:
        raise ProtocolError("a header is no list of kind, number and fields")
    if not 0 <= number <= _LARGEST_NUMBER:
        raise ProtocolError(f"a message has the number {number}")
    return Message(kind, number, fields, data)


def check_mark(frames: Sequence[Any]) -> None:
    """Check that the first frame is that of this protocol.

    Raises:
        ProtocolError: If it is not; the message names both versions where there are two.
    """
    mark = bytes(frames[0])[:40] if frames else b""
    if mark == MARK:
        return
    if mark.startswith(_NAME) and mark[len(_NAME) :].isdigit():
        theirs = int(mark[len(_NAME) :])
        raise ProtocolError(
            f"protocol {theirs} meets protocol {PROTOCOL}: use the same version of veca_marl on "
            "both machines"
        )
    raise ProtocolError("the peer is not of veca_marl")


def integer(fields: dict[str, Any], name: str, least: int, most: int) -> int:
    """Return an integer among the fields of a message.

    Raises:
        ProtocolError: If it is missing, or out of its range.
    """
    value = fields.get(name)
    if type(value) is not int or not least <= value <= most:
        raise ProtocolError(f"{name}={shown(value)} is no integer from {least} to {most}")
    return value


def number(fields: dict[str, Any], name: str, finite: bool = True) -> float:
    """Return a number among the fields of a message.

    Raises:
        ProtocolError: If it is missing, not a number, or not finite where it has to be.
    """
    value = fields.get(name)
    if isinstance(value, (int, float)) and type(value) is not bool:
        with suppress(OverflowError):
            if not (math.isnan(value) or (finite and math.isinf(value))):
                return float(value)
    raise ProtocolError(f"{name}={shown(value)} is no number")


def flag(fields: dict[str, Any], name: str) -> bool:
    """Return a flag among the fields of a message.

    Raises:
        ProtocolError: If it is missing or another thing.
    """
    value = fields.get(name)
    if type(value) is not bool:
        raise ProtocolError(f"{name}={shown(value)} is neither true nor false")
    return value


def text(fields: dict[str, Any], name: str, longest: int = 200) -> str:
    """Return a text among the fields of a message.

    Raises:
        ProtocolError: If it is missing, another thing, or longer.
    """
    value = fields.get(name)
    if type(value) is not str or len(value) > longest:
        raise ProtocolError(f"{name}={shown(value)} is no text of at most {longest} characters")
    return value


def entries(fields: dict[str, Any], name: str, most: int) -> list[Any]:
    """Return a list among the fields of a message.

    Raises:
        ProtocolError: If it is missing, another thing, or longer.
    """
    value = fields.get(name)
    if type(value) is not list or len(value) > most:
        raise ProtocolError(f"{name}={shown(value)} is no list of at most {most} entries")
    return value


def shown(value: object) -> str:
    """Return the beginning of a value in one line, for messages."""
    return ascii(value)[:60]

"""Requests of a client to a server: numbered, repeated until they are answered, within a time.

A request is sent again each second until the server has said anything about it. The server works
on each number once and keeps its last answer, so that a connection that breaks and comes back
loses nothing.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import zmq
from zmq.utils.monitor import parse_monitor_message

from veca_marl.remote.keys import ClientKeys
from veca_marl.remote.messages import (
    ACTION,
    CALL,
    DONE,
    LARGEST_ANSWER_HEADER,
    PART,
    PART_NUMBER,
    REFUSED,
    Message,
    ProtocolError,
    decode,
    integer,
    text,
)

RESEND_S = 1.0
_LOOK_MS = 100  # between looks at what happens to a new connection
_LINGER_MS = 500
_HEARTBEAT_MS, _SILENT_MS = 5_000, 20_000
_REFUSALS = (
    zmq.EVENT_HANDSHAKE_FAILED_AUTH,
    zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL,
    zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL,
    zmq.EVENT_DISCONNECTED,
)
_EVENTS = zmq.EVENT_CONNECTED | sum(_REFUSALS)
_MOST_REFUSALS = 2  # a server that is just ending refuses once


class RemoteError(RuntimeError):
    """A server cannot be reached, does not serve this client, or has lost its worlds."""


class Channel:
    """A connection to a server.

    Args:
        address: Address of the server.
        keys: Keys of this client; None for a server without keys.
        largest: Bytes of the largest frame that is read.
        timeout_s: Seconds without a word of the server after which it is given up.

    Raises:
        ValueError: If the address is none to connect to.
    """

    def __init__(
        self, address: str, keys: ClientKeys | None, largest: int, timeout_s: float
    ) -> None:
        self._address, self._has_keys, self._timeout_s = address, keys is not None, timeout_s
        self._number = 0
        self._heard = time.monotonic()
        self._met = _Meeting()
        self._whole = True
        self._socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.DEALER)
        for option, value in (
            (zmq.ROUTING_ID, b"c" + secrets.token_bytes(16)),
            (zmq.LINGER, _LINGER_MS),
            (zmq.MAXMSGSIZE, max(largest, LARGEST_ANSWER_HEADER)),
            (zmq.RCVTIMEO, round(1000 * RESEND_S)),
            (zmq.IPV6, 1),
            (zmq.HEARTBEAT_IVL, _HEARTBEAT_MS),
            (zmq.HEARTBEAT_TIMEOUT, _SILENT_MS),
        ):
            self._socket.setsockopt(option, value)
        if keys is not None:
            self._socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public.encode())
            self._socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret.encode())
            self._socket.setsockopt(zmq.CURVE_SERVERKEY, keys.server.encode())
        self._monitor: zmq.Socket[bytes] | None = self._socket.get_monitor_socket(_EVENTS)
        try:
            self._socket.connect(address)
        except zmq.ZMQError as error:  # "*" is an address to listen at
            self._stop_monitor()
            self._socket.close(0)
            raise ValueError(f"address={address} is none to connect to: {error.strerror}") from None

    def ask(self, kind: str, fields: dict[str, Any] | None = None, data: Any = b"") -> Message:
        """Send a request; return its result.

        Raises:
            ValueError: If the server says that a value is impossible.
            RuntimeError: If the server says that the call is not possible now.
            RemoteError: If it does not answer, does not serve this client, or has lost its worlds.
        """
        (answer,) = self.ask_for_parts(1, kind, fields or {}, data)
        return answer

    def ask_for_parts(
        self, parts: int, kind: str, fields: dict[str, Any], data: Any
    ) -> Iterator[Message]:
        """Send a request; yield the parts of its result, in order, each when it arrives.

        Args:
            parts: How many there are, at least 1.
            kind: What is asked for.
            fields: Its values.
            data: Raw bytes of arrays.

        Raises:
            ValueError, RuntimeError, RemoteError: See `ask`.
        """
        if self._socket.closed:
            raise RemoteError(f"the connection to {self._address} is closed; connect again")
        self._number += 1
        frames = Message(kind, self._number, fields, data).frames()
        self._heard = time.monotonic()
        part = 0
        while True:
            self._send(frames)
            while answer := self._answer(part, parts, time.monotonic() + RESEND_S):
                yield self._result(answer)
                part += 1
                if part == parts:
                    return
            if time.monotonic() - self._heard > self._timeout_s:
                raise RemoteError(self._silence())

    def _send(self, frames: list[Any]) -> None:
        self._whole = False
        with suppress(zmq.Again):  # no connection, and the queue is full: it is there
            self._socket.send_multipart(frames, zmq.NOBLOCK)
        self._whole = True

    def _answer(self, part: int, parts: int, until: float) -> Message | None:
        """Return a part of what the server answers to the present request, or its refusal.

        Returns:
            The answer; None if it has not arrived by then, or a later part has: it was lost.
        """
        while time.monotonic() < until:
            self._note_events()
            if self._monitor is not None and not self._socket.poll(_LOOK_MS):
                continue
            try:
                frames = self._socket.recv_multipart(copy=False)
            except zmq.Again:
                continue
            try:
                message = decode([frame.buffer for frame in frames], LARGEST_ANSWER_HEADER)
                self._stop_monitor()
                if message.number != self._number:  # of an earlier request, or a probe
                    continue
                if message.kind == REFUSED:
                    return message
                if message.kind not in (DONE, PART):  # the server is working on it
                    self._heard = time.monotonic()
                    continue
                arrived = integer({PART_NUMBER: 0} | message.fields, PART_NUMBER, 0, parts - 1)
            except ProtocolError as error:
                raise RemoteError(f"{self._address}: {error}") from None
            if arrived == part:
                self._heard = time.monotonic()
                return message
            if arrived > part:  # this one was lost; a server that never sends it is given up
                return None
        return None

    def _note_events(self) -> None:
        """Read what happened to the connection, before the first answer.

        Raises:
            RemoteError: If the server refuses it.
        """
        while self._monitor is not None and self._monitor.poll(0):
            event = parse_monitor_message(self._monitor.recv_multipart())["event"]
            self._met.connected |= event == zmq.EVENT_CONNECTED
            self._met.refusals += event in _REFUSALS
            if self._met.refusals >= _MOST_REFUSALS:
                raise RemoteError(self._refusal())

    def _stop_monitor(self) -> None:
        if self._monitor is not None:
            self._socket.disable_monitor()
            self._monitor.close()
            self._monitor = None

    def _result(self, answer: Message) -> Message:
        if answer.kind != REFUSED:
            return answer
        try:
            reason = text(answer.fields, "reason")
            message = " ".join(text(answer.fields, "message", 2000).split())
        except ProtocolError as error:
            raise RemoteError(f"{self._address}: {error}") from None
        if reason == ACTION:
            raise ValueError(message)
        if reason == CALL:
            raise RuntimeError(message)
        raise RemoteError(f"{self._address}: {message}")

    def _silence(self) -> str:
        if self._monitor is not None and not self._met.connected:
            return (
                f"no server answers at {self._address} (waited for {self._timeout_s:g} s); start "
                "one with python -m veca_marl.serve"
            )
        return (
            f"the server at {self._address} has not answered for {self._timeout_s:g} s (timeout_s)"
        )

    def _refusal(self) -> str:
        if self._has_keys:
            return (
                f"the server at {self._address} refuses the keys of this client: it does not know "
                "them, has others itself, or has none"
            )
        return (
            f"the server at {self._address} refuses this client, which has no keys: give the file "
            "that the server's owner has made for it (key=)"
        )

    def close(self, kind: str) -> None:
        """Tell the server that this is the end, and close the connection.

        It waits shortly for the server to confirm it: then nothing of this client is left there,
        and this process may end at once.
        """
        if self._socket.closed:
            return
        is_there = self._monitor is None or self._met.connected
        self._stop_monitor()
        self._number += 1
        with suppress(zmq.ZMQError):
            if not self._whole:  # a signal came while a message was sent: the server refuses it
                self._socket.send(b"", zmq.NOBLOCK)
            self._socket.send_multipart(Message(kind, self._number).frames(), zmq.NOBLOCK)
            if is_there:
                self._await_confirmation()
        self._socket.close()

    def _await_confirmation(self) -> None:
        """Read until the server says something about the last request, for a limited time."""
        until = time.monotonic() + _LINGER_MS / 1000
        while (left := until - time.monotonic()) > 0 and self._socket.poll(round(1000 * left)):
            frames = self._socket.recv_multipart(zmq.NOBLOCK, copy=False)
            try:
                message = decode([frame.buffer for frame in frames], LARGEST_ANSWER_HEADER)
            except ProtocolError:
                return
            if message.number == self._number:
                return


@dataclass
class _Meeting:
    """What happened to a connection before the first answer.

    Attributes:
        connected: Whether something accepts connections at the address.
        refusals: How often a connection was ended by the other side.
    """

    connected: bool = False
    refusals: int = 0

"""Lines between the server and its processes with worlds: messages in a pair of sockets.

Frames are the header and the arrays of a message, after their lengths. A process waits for what it
reads and writes; the server never does.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import time
from collections.abc import Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

_LENGTHS = struct.Struct("<II")
_SMALLEST_BUFFER = 1_000_000  # bytes; the system may give less


class BrokenLineError(OSError):
    """The other end of a line is closed, or does not read."""


def line_pair() -> tuple[Line, Connection[Any, Any]]:
    """Return the end of the server, and that which goes to a process."""
    near, far = Pipe()
    return Line(near), far


class Line:
    """The server's end of a line.

    Args:
        connection: One end of a pipe, which is taken over.
    """

    def __init__(self, connection: Connection[Any, Any]) -> None:
        self._socket = _as_socket(connection)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SMALLEST_BUFFER)
        self._begin()

    def _begin(self) -> None:
        self._lengths: tuple[int, int] | None = None
        self._buffer = bytearray(_LENGTHS.size)
        self._filled = 0

    def fileno(self) -> int:
        """Return the number of the file, for a poller."""
        return self._socket.fileno()

    def send(self, header: Any, data: Any) -> None:
        """Send a message, which is taken at once: the process reads one before it gets another.

        Raises:
            BrokenLineError: If it is not taken.
        """
        lengths = _LENGTHS.pack(len(header), len(data))
        try:
            sent = self._socket.sendmsg([lengths, header, data])
        except OSError as error:
            raise BrokenLineError(str(error)) from error
        if sent < len(lengths) + len(header) + len(data):
            raise BrokenLineError("it does not read")

    def receive(self) -> tuple[memoryview, memoryview] | None:
        """Return header and arrays of the next message; None if it is not complete yet.

        Raises:
            BrokenLineError: If the other end is closed.
        """
        while True:
            with memoryview(self._buffer) as buffer:
                try:
                    read = self._socket.recv_into(buffer[self._filled :])
                except BlockingIOError:
                    return None
                except OSError as error:
                    raise BrokenLineError(str(error)) from error
            if read == 0:
                raise BrokenLineError("it is closed")
            self._filled += read
            if self._filled < len(self._buffer):
                continue
            if self._lengths is None:
                self._lengths = _LENGTHS.unpack(self._buffer)
                self._buffer, self._filled = bytearray(sum(self._lengths)), 0
                continue
            whole, (header, _) = memoryview(self._buffer), self._lengths
            self._begin()
            return whole[:header], whole[header:]

    def close(self) -> None:
        """Close this end."""
        self._socket.close()


class FarEnd:
    """The end of a process; it waits.

    Args:
        connection: What `line_pair` has returned.
        busy_wait_s: See `veca_marl.remote.server.ServerCfg`.
    """

    def __init__(self, connection: Connection[Any, Any], busy_wait_s: float = 0.0) -> None:
        self._socket = _as_socket(connection)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SMALLEST_BUFFER)
        self._busy_wait_s = busy_wait_s
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def send(self, header: Any, data: Any) -> None:
        """Send a message.

        Raises:
            OSError: If the server has ended.
        """
        parts: Sequence[Any] = (_LENGTHS.pack(len(header), len(data)), header, data)
        left = sum(map(len, parts))
        left -= self._socket.sendmsg(parts)
        if left:
            self._socket.sendall(b"".join(map(bytes, parts))[-left:])

    def receive(self) -> tuple[bytes, bytes]:
        """Return header and arrays of the next message.

        Raises:
            EOFError: If the server has ended.
        """
        until = time.perf_counter() + self._busy_wait_s
        while time.perf_counter() < until and not self._poll.poll(0):
            pass
        header, data = _LENGTHS.unpack(self._exactly(_LENGTHS.size))
        whole = self._exactly(header + data)
        return whole[:header], whole[header:]

    def _exactly(self, size: int) -> bytes:
        content = self._socket.recv(size, socket.MSG_WAITALL)
        if len(content) < size:
            raise EOFError
        return content


def _as_socket(connection: Connection[Any, Any]) -> socket.socket:
    """Return the socket of an end of a pipe, which is closed."""
    with connection:
        return socket.socket(fileno=os.dup(connection.fileno()))

"""A client: its worlds on a server, and the games that adapters play in them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering.film import FilmCfg
from veca_marl.processes.children import call_at_the_end
from veca_marl.remote import layouts, pictures
from veca_marl.remote.address import checked_address
from veca_marl.remote.channel import Channel, RemoteError
from veca_marl.remote.description import GameSpecs
from veca_marl.remote.games import RemoteGameCfg
from veca_marl.remote.keys import load_client_keys
from veca_marl.remote.layouts import Records
from veca_marl.remote.messages import (
    CLOSE,
    HELLO,
    LARGEST_ANSWER_HEADER,
    OPEN,
    RESET,
    STATE,
    STEP,
    VIEW,
    Message,
    ProtocolError,
    entries,
    integer,
    text,
)
from veca_marl.remote.worker import seed_words
from veca_marl.version import __version__

TIMEOUT_S = 60.0
_LARGEST_PICTURE = 16_000_000  # bytes
_MOST_WORLDS = 10_000
_MOST_CLIENTS = 10_000


class RemoteWorlds:
    """The worlds of one client on a server.

    They end when they are closed or dropped, and with this process unless it is killed: the server
    has a limited number of places for clients.

    The specs come first, by a connection that reads small messages only; the second one reads
    messages that are as large as the specs say, and no larger ones.

    Args:
        address: Address of the server, such as ``tcp://host:5555``.
        key: File with the keys of this client; None for a server without keys.
        timeout_s: Seconds without a word of the server after which it is given up.

    Attributes:
        cfg: What is known of the games.
        most: Number of worlds that the server gives to a client at most.
        clients: Number of clients that may have worlds there at once.
        free: Number of those places that were free when this client connected.
        version: Version of veca_marl there.

    Raises:
        ValueError: If the address or the time is none.
        KeyFileError: If the file of keys cannot be used.
        RemoteError: If there is no server, it refuses this client, or speaks another protocol.
    """

    def __init__(
        self, address: str, key: str | Path | None = None, timeout_s: float = TIMEOUT_S
    ) -> None:
        if not (isinstance(timeout_s, (int, float)) and 0.0 < timeout_s < math.inf):
            raise ValueError(f"timeout_s={timeout_s!r} must be a positive number of seconds")
        self._address, self._timeout_s = checked_address(address), float(timeout_s)
        self._keys = None if key is None else load_client_keys(Path(key))
        welcome = self._meet()
        try:
            self.cfg = RemoteGameCfg(GameSpecs.read(welcome.fields))
            self.most = integer(welcome.fields, "worlds", 1, _MOST_WORLDS)
            self.clients = integer(welcome.fields, "clients", 1, _MOST_CLIENTS)
            self.free = integer(welcome.fields, "free", 0, self.clients)
            self._record = layouts.outcome_type(self.cfg.specs)
            self.version = text(welcome.fields, "version")
        except (ProtocolError, ValueError) as error:
            raise RemoteError(f"{address}: {error}") from None
        self._channel: Channel | None = None

    def _meet(self) -> Message:
        channel = Channel(self._address, self._keys, LARGEST_ANSWER_HEADER, self._timeout_s)
        try:
            return channel.ask(HELLO, {"version": __version__})
        finally:
            channel.close(CLOSE)

    def open(self, worlds: int) -> None:
        """Let the server build worlds.

        Raises:
            ValueError: If there are more than it gives.
            RemoteError: If it cannot.
        """
        if worlds > self.most:
            raise ValueError(
                f"worlds={worlds}: the server at {self._address} gives at most {self.most}"
            )
        largest = max(worlds * self._record.itemsize, _LARGEST_PICTURE)
        self._channel = Channel(self._address, self._keys, largest, self._timeout_s)
        self._end = call_at_the_end(self, partial(self._channel.close, CLOSE))
        try:
            self._channel.ask(OPEN, {"worlds": worlds, "digest": self.cfg.specs.digest})
        except BaseException:
            self.close()
            raise

    def reset(
        self, worlds: Sequence[int], rngs: Sequence[np.random.Generator]
    ) -> Iterator[Records]:
        """Begin an episode in each of some worlds; yield records, in order, as they arrive."""
        seeds = [seed_words(rng) for rng in rngs]
        fields = {"worlds": list(worlds), "seeds": seeds}
        return self._records(RESET, fields, b"", len(worlds))

    def step(
        self, worlds: Sequence[int], actions: Records, kinds: Sequence[str]
    ) -> Iterator[Records]:
        """Play one step in each of some worlds; yield records, in order, as they arrive."""
        fields = {"worlds": list(worlds), "kinds": list(kinds)}
        return self._records(STEP, fields, actions.tobytes(), len(worlds))

    def state(self, world: int) -> NDArray[np.float32]:
        """Return the state of a world."""
        answer = self._open.ask(STATE, {"worlds": [world]})
        if len(answer.data) != 4 * self.cfg.specs.state_size:
            raise RemoteError(f"{self._address}: a state has {len(answer.data)} bytes")
        return np.frombuffer(answer.data, "<f4").astype(np.float32)

    def picture(self, world: int, cfg: FilmCfg) -> NDArray[np.uint8]:
        """Return a picture of a world, ``(height, width, 3)``.

        Raises:
            ValueError: If it is larger than a server makes them, or there is no such agent.
        """
        answer = self._open.ask(VIEW, {"worlds": [world]} | pictures.fields_of(cfg))
        try:
            lengths = entries(answer.fields, "shape", 3)
            shape = [integer({"shape": one}, "shape", 1, _LARGEST_PICTURE) for one in lengths]
            if len(shape) != 3 or math.prod(shape) != len(answer.data):
                raise ProtocolError(f"a picture of {shape} has {len(answer.data)} bytes")
        except ProtocolError as error:
            raise RemoteError(f"{self._address}: {error}") from None
        return np.frombuffer(answer.data, np.uint8).reshape(shape).copy()

    @property
    def _open(self) -> Channel:
        assert self._channel is not None  # a host opens worlds before it plays in them
        return self._channel

    def _records(
        self, kind: str, fields: dict[str, Any], data: bytes, worlds: int
    ) -> Iterator[Records]:
        parts = list(layouts.parts(worlds))
        answers = self._open.ask_for_parts(len(parts), kind, fields, data)
        for rows, answer in zip(parts, answers, strict=True):
            try:
                yield layouts.records(answer.data, self._record, len(rows))
            except ProtocolError as error:
                raise RemoteError(f"{self._address}: {error}") from None

    def close(self) -> None:
        """End the worlds; further calls have no effect."""
        if self._channel is not None:
            self._end()

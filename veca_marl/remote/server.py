"""A server of worlds: one socket for all clients, a process with worlds for each of them.

The server itself neither simulates nor waits: it reads headers, checks that a request is the next
one of its client, and hands it on to the process of that client. What a client does, sends or
leaves unread holds up nobody else.
"""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from typing import Any

import zmq
from zmq.utils import z85

from veca_marl.processes.children import end_all, end_of, interrupts_blocked
from veca_marl.remote.address import is_loopback, numeric
from veca_marl.remote.description import GameSpecs
from veca_marl.remote.keys import ServerKeys
from veca_marl.remote.layouts import ActionLayout
from veca_marl.remote.lines import BrokenLineError, Line, line_pair
from veca_marl.remote.messages import (
    CLOSE,
    DONE,
    ENDED,
    HELLO,
    LARGEST_ANSWER_HEADER,
    LARGEST_REQUEST_HEADER,
    OPEN,
    PART,
    PEER,
    PROBE,
    REQUESTS,
    WORKING,
    Message,
    ProtocolError,
    as_frames,
    decode,
    decode_parts,
    integer,
    shown,
    text,
)
from veca_marl.remote.worker import WorldsCfg, refusal, serve_worlds
from veca_marl.version import __version__

_TICK_MS = 500
_PROBE_S = 5.0
_HEARTBEAT_MS, _SILENT_MS = 5_000, 20_000
_HANDSHAKE_MS = 10_000
_BACKLOG = 1024
_QUEUE = 16  # messages that wait for one client, or from it
_END_S = 3.0
_REMEMBERED = 1000  # clients whose worlds have ended, and why
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServerCfg:
    """A server.

    Attributes:
        address: Where it listens, such as ``tcp://127.0.0.1:5555``.
        worlds: Worlds that a client may have.
        clients: Clients that may have worlds at once.
        without_keys: Whether it may listen beyond this machine without keys.
        reconnect_s: Seconds for which the worlds of a client are kept whose connection has ended.
        limit_s: Seconds that its worlds may take for one request, or to be built.
        busy_wait_s: Seconds for which the process of a client looks for the next request before it
            sleeps. It keeps a core in use, and answers sooner: to wake a core takes long.
    """

    address: str
    worlds: int = 1
    clients: int = 8
    without_keys: bool = False
    reconnect_s: float = 60.0
    limit_s: float = 600.0
    busy_wait_s: float = 0.0005

    def check(self, has_keys: bool) -> None:
        """Check who can reach the server.

        Raises:
            ValueError: If other machines can, and it has no keys.
        """
        if not (has_keys or self.without_keys or is_loopback(self.address)):
            raise ValueError(
                f"address={self.address} can be reached from other machines: keys=FOLDER lets only "
                "clients with keys connect (without_keys=true lets everybody)"
            )


@dataclass
class _Session:
    """The worlds of one client.

    Attributes:
        client: Name of the client's connection.
        owner: Key of the client; empty without keys.
        name: Its number, for the log.
        process: The process.
        line: The line to it.
        built: Whether its worlds are built.
        number: Number of the last request.
        answer: Frames of the messages that have answered it.
        working: Whether more of them follow.
        since: When the work on it began.
        gone: When its connection was found to have ended; None while there is one.
        probed: When its connection was last checked.
    """

    client: bytes
    owner: str
    name: int
    process: BaseProcess
    line: Line
    number: int
    built: bool = False
    answer: list[list[Any]] = field(default_factory=list)
    working: bool = True
    since: float = field(default_factory=time.monotonic)
    gone: float | None = None
    probed: float = field(default_factory=time.monotonic)


class Server:
    """Serves worlds.

    Args:
        cfg: The server.
        worlds: What the worlds are made from.
        specs: Specs of the game.
        keys: Keys of the server and its clients; None for none.

    Raises:
        ValueError: If it would listen beyond this machine without keys.
        OSError: If it cannot listen at the address.
    """

    def __init__(
        self, cfg: ServerCfg, worlds: WorldsCfg, specs: GameSpecs, keys: ServerKeys | None
    ) -> None:
        cfg.check(keys is not None)
        self._cfg, self._worlds, self._specs = cfg, worlds, specs
        self._welcome = specs.fields() | {
            "version": __version__,
            "worlds": cfg.worlds,
            "clients": cfg.clients,
        }
        self._sessions: dict[bytes, _Session] = {}
        self._lines: dict[Any, _Session] = {}
        self._ended: OrderedDict[bytes, str] = OrderedDict()
        self._count = 0
        self._stack = ExitStack()
        with self._stack as stack:
            self._context = stack.enter_context(zmq.Context())
            self._gate = None if keys is None else self._gate_socket()
            self._known = frozenset(z85.decode(key) for key in keys.clients) if keys else None
            self._front = self._front_socket(keys)
            self._poller = zmq.Poller()
            self._poller.register(self._front, zmq.POLLIN)
            if self._gate is not None:
                self._poller.register(self._gate, zmq.POLLIN)
            self._start = _forking()
            stack.callback(self._end_sessions)
            self._stack = stack.pop_all()

    def _gate_socket(self) -> zmq.Socket[bytes]:
        """Return the socket at which ZeroMQ asks which keys may connect (its protocol ZAP)."""
        socket = self._stack.enter_context(self._context.socket(zmq.REP))
        socket.setsockopt(zmq.LINGER, 0)
        socket.bind("inproc://zeromq.zap.01")
        return socket

    def _front_socket(self, keys: ServerKeys | None) -> zmq.Socket[bytes]:
        socket = self._stack.enter_context(self._context.socket(zmq.ROUTER))
        largest = self._cfg.worlds * ActionLayout(self._specs.players).widest
        for option, value in (
            (zmq.LINGER, 200),
            (zmq.IPV6, int("[" in self._cfg.address)),
            (zmq.ROUTER_MANDATORY, 1),
            (zmq.ROUTER_HANDOVER, 1),
            (zmq.MAXMSGSIZE, max(LARGEST_REQUEST_HEADER, largest)),
            (zmq.SNDHWM, _QUEUE),
            (zmq.RCVHWM, _QUEUE),
            (zmq.BACKLOG, _BACKLOG),
            (zmq.HANDSHAKE_IVL, _HANDSHAKE_MS),
            (zmq.HEARTBEAT_IVL, _HEARTBEAT_MS),
            (zmq.HEARTBEAT_TIMEOUT, _SILENT_MS),
        ):
            socket.setsockopt(option, value)
        if keys is not None:
            socket.setsockopt(zmq.CURVE_SERVER, 1)
            socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret.encode())
            socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public.encode())
        try:
            socket.bind(numeric(self._cfg.address))
        except zmq.ZMQError as error:
            raise OSError(f"address={self._cfg.address}: {error.strerror}") from error
        return socket

    @property
    def address(self) -> str:
        """Where it listens; with the port that the system chose, if it was to choose one."""
        return bytes(self._front.getsockopt(zmq.LAST_ENDPOINT)).decode().rstrip("\0")

    def run(self, keep_on: Callable[[], bool] = lambda: True) -> None:
        """Serve until this process is interrupted, or is not to keep on.

        Args:
            keep_on: Asked before each wait for messages, at least twice per second.
        """
        next_check = time.monotonic()
        while keep_on():
            ready = dict(self._poller.poll(_TICK_MS))
            for session in [self._lines[one] for one in ready if one in self._lines]:
                self._from_worlds(session)
            if self._front in ready:
                self._from_client()
            if self._gate in ready:
                self._let_in()
            if time.monotonic() >= next_check:
                next_check = time.monotonic() + _TICK_MS / 1000
                self._check_sessions()

    def close(self) -> None:
        """End all worlds and stop to listen."""
        self._stack.close()

    # ---- clients

    def _let_in(self) -> None:
        """Answer the question whether a client may connect (ZAP 1.0, CURVE)."""
        assert self._gate is not None
        assert self._known is not None
        question = self._gate.recv_multipart()
        known = len(question) == 7 and question[5] == b"CURVE" and question[6] in self._known
        owner = z85.encode(question[6]) if known else b""
        verdict = (b"200", b"OK") if known else (b"400", b"unknown key")
        self._gate.send_multipart([*question[:2], *verdict, owner, b""])

    def _from_client(self) -> None:
        """Read one message of a client."""
        client, *frames = self._front.recv_multipart(zmq.NOBLOCK, copy=False)
        name = client.bytes
        try:
            request = decode([frame.buffer for frame in frames], LARGEST_REQUEST_HEADER)
            owner = "" if self._gate is None else str(frames[0].get("User-Id"))
            answer = self._handle(name, owner, request, frames)
        except ProtocolError as error:
            answer = refusal(0, PEER, str(error))
        if answer is not None:
            self._send(name, answer.frames())

    def _handle(
        self, client: bytes, owner: str, request: Message, frames: list[Any]
    ) -> Message | None:
        """Return the answer to a request of a client; None if it has been or will be sent."""
        if request.kind not in REQUESTS:
            return refusal(request.number, PEER, f"there is no request {shown(request.kind)}")
        if request.kind == HELLO:
            text(request.fields, "version")
            free = self._cfg.clients - len(self._sessions)
            return Message(DONE, request.number, self._welcome | {"free": free})
        session = self._sessions.get(client)
        if session is None:
            return self._without_worlds(client, owner, request)
        if session.owner != owner:
            return refusal(request.number, PEER, "these worlds are another client's")
        session.gone = None
        if request.kind == CLOSE:
            self._end(session, "its client has ended them")
            return Message(DONE, request.number)
        return self._next(session, request, frames)

    def _without_worlds(self, client: bytes, owner: str, request: Message) -> Message | None:
        """Return the answer to a client that has no worlds."""
        if request.kind == CLOSE:
            return Message(DONE, request.number)
        if request.kind != OPEN or client in self._ended:
            reason = self._ended.get(client, "the server has been started again, or never had them")
            return refusal(request.number, ENDED, f"the worlds of this client are gone: {reason}")
        worlds = integer(request.fields, "worlds", 1, self._cfg.worlds)
        if text(request.fields, "digest") != self._specs.digest:
            return refusal(request.number, PEER, "the games here are others by now; connect again")
        if len(self._sessions) >= self._cfg.clients:
            return refusal(request.number, PEER, self._full())
        try:
            self._begin(client, owner, worlds, request.number)
        except OSError as error:  # no memory, processes or files are left
            _LOG.warning("no process can be started: %s", error)
            return refusal(request.number, PEER, f"no process can be started there: {error}")
        return Message(WORKING, request.number)

    def _full(self) -> str:
        """Return why there is no place for another client, and when there will be one."""
        lost = sum(session.gone is not None for session in self._sessions.values())
        kept = (
            f"; {lost} of them have lost their connection: their worlds end after "
            f"{self._cfg.reconnect_s:g} s (reconnect_s)"
        )
        return (
            f"{len(self._sessions)} clients have worlds, as many as may have some at once "
            f"(clients={self._cfg.clients}){kept if lost else ''}"
        )

    def _begin(self, client: bytes, owner: str, worlds: int, number: int) -> None:
        """Start the process of a client."""
        self._count += 1
        line, far = line_pair()
        with far, interrupts_blocked():
            arguments = (far, self._worlds, worlds, self._cfg.busy_wait_s)
            process = self._start.Process(target=serve_worlds, args=arguments, daemon=True)
            process.start()
        session = _Session(client, owner, self._count, process, line, number)
        self._sessions[client] = self._lines[line.fileno()] = session
        self._poller.register(line.fileno(), zmq.POLLIN)
        _LOG.info("client %d: %d worlds", self._count, worlds)

    def _next(self, session: _Session, request: Message, frames: list[Any]) -> Message | None:
        """Hand the next request on; answer one that is worked on, or was answered, as it stands."""
        if request.number == session.number:
            if session.working:
                return Message(WORKING, request.number)
            for frames in session.answer:
                self._send(session.client, frames)
            return None
        if request.number < session.number:  # sent again before its answer came
            return None
        if request.kind == OPEN:
            return refusal(request.number, PEER, "this client has worlds already")
        if session.working:  # its client was interrupted while it waited; it will send this again
            return Message(WORKING, request.number)
        session.number, session.since = request.number, time.monotonic()
        session.answer, session.working = [], True
        try:
            session.line.send(frames[1].buffer, frames[2].buffer if len(frames) == 3 else b"")
        except BrokenLineError as error:
            self._end(session, f"their process does not take requests: {error}")
        return None

    def _send(self, client: bytes, frames: list[Any]) -> bool:
        """Send frames to a client; return whether there is a connection to it.

        They are dropped if so many wait for it that it does not read.
        """
        try:
            self._front.send_multipart([client, *frames], zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return True
        except zmq.ZMQError as error:
            if error.errno != zmq.EHOSTUNREACH:
                raise
            return False
        return True

    # ---- worlds

    def _from_worlds(self, session: _Session) -> None:
        """Hand a message of a process on to its client, when it is complete."""
        try:
            parts = session.line.receive()
        except BrokenLineError:
            session.process.join(_END_S)
            self._end(session, f"their process {end_of(session.process.exitcode)}")
            return
        if parts is None:
            return
        answer = decode_parts(*parts, LARGEST_ANSWER_HEADER)
        if session.built:
            self._answer(session, as_frames(*parts), answer.kind != PART)
            return
        self._answer(session, replace(answer, number=session.number).frames(), True)
        session.built = answer.kind == DONE
        if not session.built:
            self._end(session, text(answer.fields, "message", 2000))

    def _answer(self, session: _Session, frames: list[Any], is_last: bool) -> None:
        session.answer.append(frames)
        session.working = not is_last
        self._send(session.client, frames)

    def _check_sessions(self) -> None:
        """End worlds whose process has ended, takes too long, or whose client is gone."""
        now = time.monotonic()
        for session in list(self._sessions.values()):
            if session.process.exitcode is not None:
                self._end(session, f"their process {end_of(session.process.exitcode)}")
            elif session.working and now - session.since > self._cfg.limit_s:
                self._end(session, f"a request took longer than {self._cfg.limit_s:g} s (limit_s)")
            elif session.gone is not None or now - session.probed > _PROBE_S:
                session.probed = now
                self._probe(session, now)

    def _probe(self, session: _Session, now: float) -> None:
        """Check whether a client is still connected; end its worlds if it has not come back."""
        if self._send(session.client, Message(PROBE).frames()):
            session.gone = None
        elif session.gone is None:
            session.gone = now
        elif now - session.gone > self._cfg.reconnect_s:
            self._end(session, f"the client was gone for {self._cfg.reconnect_s:g} s (reconnect_s)")

    def _end(self, session: _Session, reason: str) -> None:
        """End the worlds of a client, which gets to know why."""
        del self._sessions[session.client]
        self._ended[session.client] = reason
        while len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)
        del self._lines[session.line.fileno()]
        self._poller.unregister(session.line.fileno())
        session.line.close()
        _LOG.info("client %d: its worlds have ended: %s", session.name, reason)
        # the answer to the present request, or to the next one, which the server may not see
        number = session.number + (not session.working)
        lost = f"the worlds of this client are gone: {reason}"
        self._send(session.client, refusal(number, ENDED, lost).frames())
        session.process.kill()

    def _end_sessions(self) -> None:
        """End all worlds, and tell their clients."""
        sessions = list(self._sessions.values())
        for session in sessions:
            self._end(session, "the server was stopped")
        end_all([session.process for session in sessions], _END_S)


def _forking() -> ForkServerContext:
    """Return what starts processes in 0.02 s each: forks of one that has imported the simulator.

    This process has threads, those of ZeroMQ, and must not be forked itself.
    """
    context = get_context("forkserver")
    context.set_forkserver_preload([serve_worlds.__module__])
    first = context.Process(target=len, args=((),))
    with interrupts_blocked():
        first.start()  # waits for the imports
    first.join()
    return context

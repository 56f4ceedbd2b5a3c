"""The worlds of one client, in a process of their own.

The process believes no more of a request than the server does: world indices, episodes and sizes
are checked before anything moves. An error of a request is an answer; the worlds stay.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.global_state import GlobalState
from veca_marl.envs.rendering import Spectator
from veca_marl.plugins import load_plugins
from veca_marl.processes.children import prepare_child
from veca_marl.remote import layouts, pictures
from veca_marl.remote.description import GameSpecs
from veca_marl.remote.lines import FarEnd
from veca_marl.remote.messages import (
    ACTION,
    CALL,
    DONE,
    LARGEST_REQUEST_HEADER,
    PART,
    PART_NUMBER,
    PEER,
    REFUSED,
    RESET,
    STATE,
    STEP,
    VIEW,
    Message,
    ProtocolError,
    decode_parts,
    entries,
    integer,
    shown,
)

LARGEST_SEED_BYTES = 64
"""Bytes of the largest number that seeds an episode."""


@dataclass(frozen=True)
class WorldsCfg:
    """What the worlds of a server are made from; it is pickled for its own processes only.

    Attributes:
        game: The game.
        plugins: Packages that it needs, see `veca_marl.plugins`.
    """

    game: GameCfg
    plugins: tuple[str, ...] = ()


class WorldServer:
    """Answers the requests of one client.

    Args:
        cfg: The game.
        worlds: Number of worlds.
    """

    def __init__(self, cfg: GameCfg, worlds: int) -> None:
        self._games = [Game(cfg) for _ in range(worlds)]
        game = self._games[0]
        self._specs = GameSpecs.of(game)
        self._type = layouts.outcome_type(self._specs)
        self._actions = layouts.ActionLayout(self._specs.players)
        self._fields = layouts.outcome_fields(self._specs)
        self._blocks: dict[int, tuple[layouts.Records, layouts.Columns]] = {}
        self._states = [GlobalState(game) for game in self._games]
        self._spectators = [Spectator(game) for game in self._games]
        self._answers: dict[str, Callable[[Message], Iterator[Message]]] = {
            RESET: self._reset,
            STEP: self._step,
            STATE: self._state,
            VIEW: self._view,
        }

    def answers(self, request: Message) -> Iterator[Message]:
        """Yield the answer to a request: the parts of its result, or why it is refused.

        A part is to be sent before the next one is asked for.
        """
        try:
            if request.kind not in self._answers:
                raise ProtocolError(f"there is no request {shown(request.kind)} to worlds")
            yield from self._answers[request.kind](request)
        except ProtocolError as error:
            yield refusal(request.number, PEER, str(error))
        except ValueError as error:
            yield refusal(request.number, ACTION, str(error))
        except Exception as error:  # of a task of users too: the client has to learn of it
            yield refusal(request.number, CALL, f"{type(error).__name__}: {error}")

    def _worlds(self, request: Message) -> list[int]:
        """Return the worlds that a request is about, each once."""
        most = len(self._games)
        worlds = [
            integer({"worlds": world}, "worlds", 0, most - 1)
            for world in entries(request.fields, "worlds", most)
        ]
        if len(set(worlds)) < len(worlds) or not worlds:
            raise ProtocolError(f"worlds={shown(worlds)} are none, or some twice")
        return worlds

    def _block(self, worlds: int) -> tuple[layouts.Records, layouts.Columns]:
        """Return records of some worlds, and their fields; those of the last answer, if it fits.

        New memory costs as much as the copies into it.
        """
        if worlds not in self._blocks:
            records = np.zeros(worlds, self._type)
            self._blocks = {worlds: (records, layouts.columns(records))}
        elif self._specs.eliminates:  # players that were eliminated before are not written
            self._blocks[worlds][0].view(np.uint8).fill(0)
        return self._blocks[worlds]

    def _in_parts(
        self, request: Message, worlds: list[int], play: Callable[[layouts.Columns, int], None]
    ) -> Iterator[Message]:
        """Play in some worlds; yield parts of the result, each when its rows are written.

        Args:
            request: What is answered.
            worlds: The worlds.
            play: Plays in the world of a row, and writes that row of the given columns.
        """
        records, columns = self._block(len(worlds))
        for number, rows in enumerate(layouts.parts(len(worlds))):
            for row in rows:
                play(columns, row)
            kind = DONE if rows.stop == len(worlds) else PART
            data: Any = records[rows.start : rows.stop].view(np.uint8)
            yield Message(kind, request.number, {PART_NUMBER: number}, memoryview(data))

    def _reset(self, request: Message) -> Iterator[Message]:
        worlds = self._worlds(request)
        seeds = entries(request.fields, "seeds", len(worlds))
        if len(seeds) != len(worlds):
            raise ProtocolError(f"{len(seeds)} seeds for {len(worlds)} worlds")
        generators = [_generator(seed) for seed in seeds]

        def begin(columns: layouts.Columns, row: int) -> None:
            self._games[worlds[row]].reset(generators[row])
            self._write(columns, row, worlds[row], frozenset())

        yield from self._in_parts(request, worlds, begin)

    def _step(self, request: Message) -> Iterator[Message]:
        worlds = self._worlds(request)
        kinds = entries(request.fields, "kinds", len(self._actions.kinds))
        record = self._actions.record([kind for kind in kinds if type(kind) is str])
        actions = layouts.columns(layouts.records(request.data, record, len(worlds)))
        for row, world in enumerate(worlds):
            self._command(world, actions, row)

        def advance(columns: layouts.Columns, row: int) -> None:
            game = self._games[worlds[row]]
            eliminated = game.eliminated
            outcome = game.advance()
            self._write(columns, row, worlds[row], eliminated)
            self._score(columns, row, worlds[row], outcome)

        yield from self._in_parts(request, worlds, advance)

    def _command(self, world: int, actions: layouts.Columns, row: int) -> None:
        given = {
            player.name: {part: actions[field][row] for part, field in fields.items()}
            for player, fields in zip(self._specs.players, self._actions.fields, strict=True)
        }
        try:
            self._games[world].command(given)
        except ValueError as error:
            raise ValueError(f"world {world}, {error}") from None

    def _write(
        self, columns: layouts.Columns, row: int, world: int, eliminated: frozenset[str]
    ) -> None:
        """Write observations and the state of a world, except of players eliminated before."""
        game = self._games[world]
        if self._specs.global_state:
            columns[layouts.STATE][row] = self._states[world].read()
        for index, (player, fields) in enumerate(zip(game.actors, self._fields, strict=True)):
            columns[layouts.ELIMINATED][row, index] = player.name in game.eliminated
            if fields.info:
                columns[fields.info][row] = list(player.body.info().values())
            if player.name in eliminated:
                continue
            columns[layouts.OBSERVED][row, index] = True
            for name, value in game.observe(player).items():
                columns[fields.observations[name]][row] = value

    def _score(self, columns: layouts.Columns, row: int, world: int, outcome: Outcome) -> None:
        """Write reward terms and flags of a world."""
        game = self._games[world]
        columns[layouts.ENDED][row] = outcome.terminated, outcome.truncated
        for index, player in enumerate(game.actors):
            terms = outcome.terms[player.name]
            columns[layouts.REWARD][row, index] = game.reward_of(terms)
            columns[layouts.TERMS][row, index] = [terms[name] for name in game.weights]
            if outcome.solved:
                columns[layouts.SOLVED][row, index] = outcome.solved[player.name]

    def _state(self, request: Message) -> Iterator[Message]:
        (world,) = self._one(request)
        yield Message(DONE, request.number, data=self._states[world].read().tobytes())

    def _view(self, request: Message) -> Iterator[Message]:
        (world,) = self._one(request)
        picture = self._spectators[world].frame(**pictures.choices_of(request.fields))
        fields = {"shape": list(picture.shape)}
        yield Message(DONE, request.number, fields, np.ascontiguousarray(picture).tobytes())

    def _one(self, request: Message) -> Sequence[int]:
        worlds = self._worlds(request)
        if len(worlds) != 1:
            raise ProtocolError(f"{request.kind} is about one world")
        if not self._games[worlds[0]].has_begun:
            raise RuntimeError("no episode has begun: call reset() first")
        return worlds

    def close(self) -> None:
        """Release the resources of all worlds."""
        for game in self._games:
            game.close()


def refusal(number: int, reason: str, message: str) -> Message:
    """Return an answer that refuses a request."""
    return Message(REFUSED, number, {"reason": reason, "message": message[:2000]})


def seed_words(rng: np.random.Generator) -> list[bytes]:
    """Return what the generator of an episode was made from, which no draw has changed yet.

    Raises:
        ValueError: If a number of it is too large.
    """
    entropy: Any = rng.bit_generator.seed_seq.entropy  # type: ignore[attr-defined]
    numbers = [int(number) for number in (entropy if isinstance(entropy, list) else [entropy])]
    for number in numbers:
        if number >= 256**LARGEST_SEED_BYTES:
            raise ValueError(f"seed={number} has more than {LARGEST_SEED_BYTES} bytes")
    return [number.to_bytes(LARGEST_SEED_BYTES, "little").rstrip(b"\0") for number in numbers]


def _generator(words: Any) -> np.random.Generator:
    """Return the generator that `seed_words` describes, before its first draw."""
    if type(words) is not list or not 1 <= len(words) <= 8:
        raise ProtocolError(f"seeds of an episode are {shown(words)}")
    for word in words:
        if type(word) is not bytes or len(word) > LARGEST_SEED_BYTES:
            raise ProtocolError(f"a seed is {shown(word)}")
    numbers = [int.from_bytes(word, "little") for word in words]
    return np.random.Generator(np.random.PCG64(numbers))


def serve_worlds(
    connection: Connection[Any, Any], cfg: WorldsCfg, worlds: int, busy_wait_s: float
) -> None:
    """Build worlds and answer requests until this process is ended.

    Args:
        connection: The line to the server.
        cfg: The game.
        worlds: Number of worlds.
        busy_wait_s: See `veca_marl.remote.server.ServerCfg`.
    """
    prepare_child(os.getppid())  # the process that forks those with worlds, ends with the server
    line = FarEnd(connection, busy_wait_s)
    try:
        load_plugins(cfg.plugins)
        server = WorldServer(cfg.game, worlds)
    except Exception as error:  # the client has to learn of it
        reason = f"the worlds cannot be built: {type(error).__name__}: {error}"
        line.send(*refusal(0, PEER, reason).parts())
        return
    line.send(*Message(DONE).parts())
    with suppress(EOFError, ConnectionError):  # the server has ended
        while True:
            for answer in _answers(server, *line.receive()):
                line.send(*answer.parts())


def _answers(server: WorldServer, header: bytes, data: bytes) -> Iterator[Message]:
    try:
        request = decode_parts(header, data, LARGEST_REQUEST_HEADER)
    except ProtocolError as error:
        yield refusal(0, PEER, str(error))
    else:
        yield from server.answers(request)

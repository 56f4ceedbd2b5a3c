"""Arrays of a step as one block of bytes: a record for each world, of a size that specs give.

A block is accepted only if its size is the number of worlds times the size of a record; nothing
in it is a pointer, a length or a type. Numbers are little-endian.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.remote.description import TYPES, GameSpecs, PlayerSpecs
from veca_marl.remote.messages import ProtocolError, shown

Records = NDArray[np.void]
Columns = dict[str, NDArray[Any]]

ENDED = "ended"
"""Field ``(2,)`` with two flags, whether the episode has ended by the rules, and by its time."""
STATE = "state"
OBSERVED, ELIMINATED, SOLVED = "observed", "eliminated", "solved"
"""Fields with a flag for each player."""
REWARD, TERMS = "reward", "terms"


def observation_field(player: int, name: str) -> str:
    """Return the name of the field of one observation of a player."""
    return f"{player}.{name}"


def info_field(player: int) -> str:
    """Return the name of the field of what a player's body reports."""
    return f"{player}:info"


class PlayerFields(NamedTuple):
    """Fields of one player.

    Attributes:
        observations: That of each observation.
        info: That of what its body reports; empty if that is nothing.
    """

    observations: dict[str, str]
    info: str


def outcome_fields(specs: GameSpecs) -> list[PlayerFields]:
    """Return the fields of each player."""
    return [
        PlayerFields(
            {name: observation_field(index, name) for name in player.observations},
            info_field(index) if player.info else "",
        )
        for index, player in enumerate(specs.players)
    ]


def parts(worlds: int) -> Iterator[range]:
    """Yield the rows of each part of a result for some worlds.

    A part has half of the rows that are left: a client reads it while the next worlds are
    simulated, and of the last one waits for a single record.
    """
    first = 0
    while first < worlds:
        end = first + (worlds - first + 1) // 2
        yield range(first, end)
        first = end


def columns(block: Records) -> Columns:
    """Return the arrays of all fields of a block, without a copy; the first axis is the world."""
    return {name: block[name] for name in block.dtype.names or ()}


def outcome_type(specs: GameSpecs) -> np.dtype[np.void]:
    """Return the record of one world after a reset or a step.

    Observations of players that were eliminated before are not among them: their bytes are 0.
    """
    players = len(specs.players)
    fields: list[Any] = [
        (REWARD, "<f8", (players,)),
        (TERMS, "<f8", (players, len(specs.weights))),
        *((info_field(i), "<f8", (len(one.info),)) for i, one in enumerate(specs.players)),
        (ENDED, "?", (2,)),
        *((name, "?", (players,)) for name in (OBSERVED, ELIMINATED, SOLVED)),
    ]
    if specs.global_state:
        fields.append((STATE, "<f4", (specs.state_size,)))
    for index, player in enumerate(specs.players):
        for name, spec in player.observations.items():
            fields.append((observation_field(index, name), _wire(spec.dtype), spec.shape))
    return np.dtype(fields, align=True)


def action_field(player: int, part: str) -> str:
    """Return the name of the field of one part of a player's action."""
    return f"{player}.{part}"


class ActionLayout:
    """Records of the actions of one world.

    An action may have another type than its spec, with which a body would compute: a record is
    described by the types of all parts of all players, in their order.

    Args:
        players: The players.

    Attributes:
        fields: Field of each part of each player.
        kinds: Types of the parts as the specs have them.
    """

    def __init__(self, players: Sequence[PlayerSpecs]) -> None:
        self.fields = [
            {part: action_field(index, part) for part in player.action}
            for index, player in enumerate(players)
        ]
        self._specs = [spec for player in players for spec in player.action.values()]
        self._names = [name for parts in self.fields for name in parts.values()]
        self.kinds = tuple(np.dtype(spec.dtype).name for spec in self._specs)
        self._types: dict[tuple[str, ...], np.dtype[np.void]] = {}

    def record(self, kinds: Sequence[str]) -> np.dtype[np.void]:
        """Return the record of parts of some types.

        Raises:
            ProtocolError: If one is no type, or no type of such a part.
        """
        key = tuple(kinds)
        if key not in self._types:
            if len(self._types) > _MOST_TYPES:
                self._types.clear()
            self._types[key] = self._made(key)
        return self._types[key]

    def _made(self, kinds: tuple[str, ...]) -> np.dtype[np.void]:
        if len(kinds) != len(self._specs):
            raise ProtocolError(f"an action has {len(kinds)} types for {len(self._specs)} parts")
        for name, spec, kind in zip(self._names, self._specs, kinds, strict=True):
            allowed = "iu" if spec.is_discrete else "fiu"
            if kind not in TYPES or np.dtype(kind).kind not in allowed:
                raise ProtocolError(f"action {name} is of type {shown(kind)}")
        parts = zip(self._names, kinds, self._specs, strict=True)
        return np.dtype([(name, _wire(kind), spec.shape) for name, kind, spec in parts], align=True)

    @property
    def widest(self) -> int:
        """The greatest size in bytes of the actions of one world."""
        kinds = ["int64" if spec.is_discrete else "float64" for spec in self._specs]
        return self.record(kinds).itemsize

    def kinds_of(self, actions: Sequence[Sequence[NDArray[Any]]]) -> tuple[str, ...]:
        """Return the types that hold the actions of some worlds.

        Args:
            actions: All parts of all players of each world, in their order.
        """
        if all(
            part.dtype == spec.dtype
            for world in actions
            for part, spec in zip(world, self._specs, strict=True)
        ):
            return self.kinds
        return tuple(np.result_type(*column).name for column in zip(*actions, strict=True))


_MOST_TYPES = 64


def records(data: Any, record: np.dtype[np.void], worlds: int) -> Records:
    """Return a block of bytes as records, without a copy.

    Raises:
        ProtocolError: If it has another size.
    """
    if len(data) != worlds * record.itemsize:
        raise ProtocolError(
            f"arrays have {len(data)} bytes; {worlds} worlds of {record.itemsize} were expected"
        )
    return np.frombuffer(data, record)


def _wire(kind: Any) -> np.dtype[Any]:
    wire: np.dtype[Any] = np.dtype(kind).newbyteorder("<")
    return wire

"""Arrays of a step as one block of bytes: a record for each world, of a size that specs give.

A block is accepted only if its size is the number of worlds times the size of a record; nothing
in it is a pointer, a length or a type. Numbers are little-endian.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.remote.description import TYPES, GameSpecs, PlayerSpecs
from veca_marl.remote.messages import ProtocolError, shown

Records = NDArray[np.void]

ENDED = "ended"
"""Field ``(2,)``: whether the episode has ended by the rules, and whether its time is up."""
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


@lru_cache(maxsize=64)
def _action_type(parts: tuple[tuple[str, tuple[int, ...], str], ...]) -> np.dtype[np.void]:
    return np.dtype([(name, _wire(kind), shape) for name, shape, kind in parts], align=True)


def action_type(players: Sequence[PlayerSpecs], kinds: Sequence[str]) -> np.dtype[np.void]:
    """Return the record of the actions of one world.

    Args:
        players: The players.
        kinds: Names of the types of all parts of all players, in their order: an action may have
            another type than its spec, which a body would compute with.

    Raises:
        ProtocolError: If one is no type, or no type of such a part.
    """
    parts = [
        (action_field(index, part), spec)
        for index, player in enumerate(players)
        for part, spec in player.action.items()
    ]
    if len(kinds) != len(parts):
        raise ProtocolError(f"an action has {len(kinds)} types for {len(parts)} parts")
    for (name, spec), kind in zip(parts, kinds, strict=True):
        allowed = "iu" if spec.is_discrete else "fiu"
        if kind not in TYPES or np.dtype(kind).kind not in allowed:
            raise ProtocolError(f"action {name} is of type {shown(kind)}")
    named = ((name, spec.shape, kind) for (name, spec), kind in zip(parts, kinds, strict=True))
    return _action_type(tuple(named))


def spec_kinds(players: Sequence[PlayerSpecs]) -> list[str]:
    """Return the types of all parts of all players' actions as their specs have them."""
    return [np.dtype(s.dtype).name for player in players for s in player.action.values()]


def widest_action(players: Sequence[PlayerSpecs]) -> int:
    """Return the greatest size in bytes of the actions of one world."""
    kinds = [
        "int64" if spec.is_discrete else "float64"
        for player in players
        for spec in player.action.values()
    ]
    return action_type(players, kinds).itemsize


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

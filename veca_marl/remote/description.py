"""What a server says of its games: teams, senses, actions, reward terms, clock."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np

from veca_marl.envs.core.game import ActionSpec, Game
from veca_marl.envs.core.global_state import GlobalState
from veca_marl.remote.messages import ProtocolError, entries, flag, integer, number, shown, text
from veca_marl.sim.sense import ArraySpec

_INTEGERS = tuple(f"{sign}int{bits}" for bits in (8, 16, 32, 64) for sign in ("u", ""))
TYPES = ("bool", *_INTEGERS, "float16", "float32", "float64")
"""Types of arrays on the wire, little-endian."""
_MOST_AXES = 8
_MOST_PLAYERS = 1000
_MOST_NAMES = 2000  # of senses, parts, terms, choices
_LONGEST_CONFIGURATION = 256_000
_LARGEST_WORLD = 512_000_000  # bytes of one array


@dataclass(frozen=True)
class PlayerSpecs:
    """One player whose actions a client gives.

    Attributes:
        name: Unique in its game.
        team: Name of its team.
        senses: Specs of its observations by name, for each of its senses.
        action: Specs of the parts of its action.
        info: Names of what its body reports, see `Body.info`.
    """

    name: str
    team: str
    senses: Mapping[str, Mapping[str, ArraySpec]]
    action: ActionSpec
    info: tuple[str, ...]

    @property
    def observations(self) -> dict[str, ArraySpec]:
        """Specs of all observations, in the order in which `Game.observe` returns them."""
        return {name: spec for sense in self.senses.values() for name, spec in sense.items()}


@dataclass(frozen=True)
class GameSpecs:
    """One game, as far as those who play it have to know it.

    Attributes:
        task: Name of the task.
        players: The players whose actions a client gives, team by team.
        weights: Weight of each reward term in a step.
        has_goal: Whether the task has a goal.
        eliminates: Whether players can be eliminated.
        state_size: Length of the state, see `GlobalState`.
        global_state: Whether the TorchRL environment has the key ``state``.
        rate_hz: Agent steps per second.
        max_steps: Steps after which an episode is truncated.
        configuration: The configuration of the games as YAML, to be read by people.
    """

    task: str
    players: tuple[PlayerSpecs, ...]
    weights: dict[str, float]
    has_goal: bool
    eliminates: bool
    state_size: int
    global_state: bool
    rate_hz: int
    max_steps: int
    configuration: str = ""

    @classmethod
    def of(cls, game: Game, configuration: str = "") -> GameSpecs:
        """Return the specs of a game."""
        players = tuple(
            PlayerSpecs(
                player.name,
                player.team,
                {name: dict(one.specs) for name, one in game.senses[player.name].items()},
                player.body.action_spec,
                tuple(player.body.info()),
            )
            for player in game.actors
        )
        return cls(
            game.cfg.task.name,
            players,
            {name: float(weight) for name, weight in game.weights.items()},
            game.task.has_goal(),
            game.task.eliminates,
            GlobalState(game).size,
            game.cfg.global_state,
            game.cfg.clock.control_rate_hz,
            game.max_steps,
            configuration,
        )

    def fields(self) -> dict[str, Any]:
        """Return the specs as fields of a message."""
        return {
            "task": self.task,
            "players": [_player_fields(player) for player in self.players],
            "weights": [[name, weight] for name, weight in self.weights.items()],
            "has_goal": self.has_goal,
            "eliminates": self.eliminates,
            "state_size": self.state_size,
            "global_state": self.global_state,
            "rate_hz": self.rate_hz,
            "max_steps": self.max_steps,
            "configuration": self.configuration,
        }

    @classmethod
    def read(cls, fields: dict[str, Any]) -> GameSpecs:
        """Return the specs in the fields of a message.

        Raises:
            ProtocolError: If there are none, or something in them is no part of a game.
        """
        players = tuple(map(_read_player, entries(fields, "players", _MOST_PLAYERS)))
        names = [player.name for player in players]
        if not players or len(set(names)) < len(names):
            raise ProtocolError(f"a game has the players {shown(names)}")
        weights = {}
        for pair in entries(fields, "weights", _MOST_NAMES):
            entry = dict(zip(("name", "weight"), _as_list(pair, 2), strict=True))
            weights[text(entry, "name")] = number(entry, "weight")
        return cls(
            text(fields, "task"),
            players,
            weights,
            flag(fields, "has_goal"),
            flag(fields, "eliminates"),
            integer(fields, "state_size", 0, 10**7),
            flag(fields, "global_state"),
            integer(fields, "rate_hz", 1, 10**6),
            integer(fields, "max_steps", 1, 10**12),
            text(fields, "configuration", _LONGEST_CONFIGURATION),
        )

    @property
    def digest(self) -> str:
        """A hash of the specs and the configuration."""
        return hashlib.sha256(msgpack.packb(self.fields())).hexdigest()


def _player_fields(player: PlayerSpecs) -> dict[str, Any]:
    return {
        "name": player.name,
        "team": player.team,
        "senses": [
            [sense, [_array_fields(name, spec) for name, spec in specs.items()]]
            for sense, specs in player.senses.items()
        ],
        "action": [_array_fields(part, spec) for part, spec in player.action.items()],
        "info": list(player.info),
    }


def _read_player(fields: Any) -> PlayerSpecs:
    player = _as_mapping(fields)
    senses = {}
    for pair in entries(player, "senses", _MOST_NAMES):
        entry = dict(zip(("sense", "specs"), _as_list(pair, 2), strict=True))
        specs = entries(entry, "specs", _MOST_NAMES)
        senses[text(entry, "sense")] = dict(map(_read_array, specs))
    action = dict(map(_read_array, entries(player, "action", _MOST_NAMES)))
    if not action:
        raise ProtocolError("a player has no action")
    info = entries(player, "info", _MOST_NAMES)
    names = tuple(text({"info": name}, "info") for name in info)
    return PlayerSpecs(text(player, "name"), text(player, "team"), senses, action, names)


def _array_fields(name: str, spec: ArraySpec) -> dict[str, Any]:
    return {
        "name": name,
        "shape": list(spec.shape),
        "type": np.dtype(spec.dtype).name,
        "low": float(spec.low),
        "high": float(spec.high),
        "names": list(spec.names),
    }


def _read_array(fields: Any) -> tuple[str, ArraySpec]:
    array = _as_mapping(fields)
    kind = text(array, "type")
    if kind not in TYPES:
        raise ProtocolError(f"type={shown(kind)}; choices: {', '.join(TYPES)}")
    lengths = entries(array, "shape", _MOST_AXES)
    shape = tuple(integer({"shape": one}, "shape", 0, _LARGEST_WORLD) for one in lengths)
    if math.prod(shape) * np.dtype(kind).itemsize > _LARGEST_WORLD:
        raise ProtocolError(f"shape={shown(shape)} has more than {_LARGEST_WORLD} bytes")
    low, high = number(array, "low", finite=False), number(array, "high", finite=False)
    spec = ArraySpec(shape, np.dtype(kind).type, low, high, _read_names(array))
    if spec.is_discrete and not 0.0 <= high < 2**31:
        raise ProtocolError(f"high={high:g} is no number of choices")
    return text(array, "name"), spec


def _read_names(array: dict[str, Any]) -> tuple[str, ...]:
    return tuple(text({"names": one}, "names") for one in entries(array, "names", _MOST_NAMES))


def _as_mapping(value: Any) -> dict[str, Any]:
    if type(value) is not dict:
        raise ProtocolError(f"{shown(value)} is no mapping")
    return value


def _as_list(value: Any, length: int) -> list[Any]:
    if type(value) is not list or len(value) != length:
        raise ProtocolError(f"{shown(value)} is no list of {length}")
    return value

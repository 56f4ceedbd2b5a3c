"""The `move` part of a walker's action: continuous velocities, or one of a few moves."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.physics.interactions import NO_VERB
from veca_marl.sim.sound import Call
from veca_marl.sim.spec import ArraySpec, continuous_spec, discrete_spec

# (forward, turn) as fractions of the greatest speeds; turning left is positive
MOVES: dict[str, tuple[float, float]] = {
    "stand": (0.0, 0.0),
    "forward": (1.0, 0.0),
    "backward": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
    "forward_left": (1.0, 1.0),
    "forward_right": (1.0, -1.0),
}


class WalkCommand(NamedTuple):
    """What an expert commands a walker to do in the next step.

    Attributes:
        forward: Walking velocity as a fraction of the greatest, in [-1, 1].
        turn: Turning velocity likewise, left positive.
        call: The call; ignored by a body without the action part `voice`.
        verb: Name of the verb, see `WalkerCfg.verbs`.
    """

    forward: float
    turn: float
    call: Call = Call.none
    verb: str = NO_VERB


class WalkAction(Protocol):
    """Converts between the `move` part and fractions of the greatest walking and turning speed.

    Attributes:
        spec: Of the part.
    """

    spec: ArraySpec

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return (forward, turn), each in [-1, 1], for a value that the spec admits."""
        ...

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the value of the part that comes nearest to (forward, turn)."""
        ...


class ContinuousWalk:
    """Two numbers ``(2,)``: forward and turning velocity in [-1, 1], left positive."""

    spec = continuous_spec(("forward", "turn"))

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return the two numbers."""
        return float(move[0]), float(move[1])

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the two numbers, clipped to [-1, 1]."""
        return np.clip(np.array([forward, turn], np.float32), self.spec.low, self.spec.high)


class DiscreteWalk:
    """One of `MOVES`, by its index."""

    spec = discrete_spec(tuple(MOVES))
    _moves = tuple(MOVES.values())

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return the fractions of the chosen move."""
        return self._moves[int(move)]

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the index of the move with the nearest fractions."""
        away = np.array(self._moves) - (forward, turn)
        return np.asarray(np.argmin((away**2).sum(axis=1)), self.spec.dtype)


class WalkActionKind(Enum):
    """Whether the `move` part is continuous or discrete."""

    continuous = "continuous"
    discrete = "discrete"


WALK_ACTIONS: dict[WalkActionKind, WalkAction] = {
    WalkActionKind.continuous: ContinuousWalk(),
    WalkActionKind.discrete: DiscreteWalk(),
}

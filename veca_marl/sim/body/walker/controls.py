"""Action rows of the walking body: continuous velocities, or one of a few moves."""

from __future__ import annotations

from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.spec import ArraySpec

# (forward, turn) as shares of the greatest speeds; turning left is positive
MOVES: dict[str, tuple[float, float]] = {
    "stand": (0.0, 0.0),
    "forward": (1.0, 0.0),
    "backward": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
    "forward_left": (1.0, 1.0),
    "forward_right": (1.0, -1.0),
}


class WalkControl(Protocol):
    """Turns an action row into shares of the greatest walking and turning speed."""

    spec: ArraySpec

    def decode(self, row: NDArray[Any]) -> tuple[float, float]:
        """Return (forward, turn), each in [-1, 1]; raise `ValueError` for an impossible row."""
        ...

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the row that comes nearest to a wish, such as an expert's."""
        ...


class ContinuousWalk:
    """A row ``(2,)``: forward and turning velocity in [-1, 1], left positive."""

    spec = ArraySpec((2,), np.float32, -1.0, 1.0)

    def decode(self, row: NDArray[Any]) -> tuple[float, float]:
        """Return the row itself, checked."""
        if np.shape(row) != self.spec.shape:
            raise ValueError(f"action {row!r} must be the two numbers (forward, turn)")
        forward, turn = float(row[0]), float(row[1])
        # written so that a NaN fails as well
        if not (-1.0 <= forward <= 1.0 and -1.0 <= turn <= 1.0):
            raise ValueError(f"action {row!r} must be (forward, turn), each in [-1, 1]")
        return forward, turn

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the wish itself, cut to the range."""
        return np.clip(np.array([forward, turn], np.float32), self.spec.low, self.spec.high)


class DiscreteWalk:
    """A scalar: the index of one of `MOVES`."""

    spec = ArraySpec((), np.int64, 0, len(MOVES) - 1)
    _moves = tuple(MOVES.values())

    def decode(self, row: NDArray[Any]) -> tuple[float, float]:
        """Look the move up."""
        choice = np.asarray(row)
        if choice.shape != () or choice.dtype.kind not in "iu" or not 0 <= choice < len(MOVES):
            raise ValueError(f"action {row!r} is not one of the moves {dict(enumerate(MOVES))}")
        return self._moves[int(choice)]

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the index of the move with the nearest shares."""
        away = np.array(self._moves) - (forward, turn)
        return np.asarray(np.argmin((away**2).sum(axis=1)), self.spec.dtype)


class ActionKind(Enum):
    """How a walking body is commanded."""

    continuous = "continuous"
    discrete = "discrete"


WALK_CONTROLS: dict[ActionKind, WalkControl] = {
    ActionKind.continuous: ContinuousWalk(),
    ActionKind.discrete: DiscreteWalk(),
}

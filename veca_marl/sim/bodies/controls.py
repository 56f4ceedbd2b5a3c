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


class ContinuousWalk:
    """A row ``(2,)``: forward and turning velocity in [-1, 1], left positive."""

    spec = ArraySpec((2,), np.float32, -1.0, 1.0)

    def decode(self, row: NDArray[Any]) -> tuple[float, float]:
        """Return the row itself, checked."""
        forward, turn = row
        # written so that a NaN fails as well
        if not (-1.0 <= forward <= 1.0 and -1.0 <= turn <= 1.0):
            raise ValueError(f"action {row!r} must be (forward, turn), each in [-1, 1]")
        return float(forward), float(turn)


class DiscreteWalk:
    """A scalar: the index of one of `MOVES`."""

    spec = ArraySpec((), np.int64, 0, len(MOVES) - 1)
    _moves = tuple(MOVES.values())

    def decode(self, row: NDArray[Any]) -> tuple[float, float]:
        """Look the move up."""
        index = int(row)
        if not 0 <= index < len(MOVES):
            choices = dict(enumerate(MOVES))
            raise ValueError(f"action {index} is not one of the moves {choices}")
        return self._moves[index]


class ActionKind(Enum):
    """How a walking body is commanded."""

    continuous = "continuous"
    discrete = "discrete"


WALK_CONTROLS: dict[ActionKind, WalkControl] = {
    ActionKind.continuous: ContinuousWalk(),
    ActionKind.discrete: DiscreteWalk(),
}

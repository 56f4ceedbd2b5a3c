"""Action rows of bodies that also call.

Policy heads know one continuous or one categorical row per agent, so a call is part of that row:

- continuous, walking or joint by joint: one more number. Five equal bands of [-1, 1] are the five
  calls, silence in the middle, so that a row of zeros is silent; a policy that explores widely
  calls most of the time;
- discrete: the product of moves and calls. The silent ones come first, so that what was chosen
  without a voice is chosen with the same numbers.

A head of its own for the call would need a composite distribution, which not all losses take.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.walker.controls import (
    WALK_CONTROLS,
    ActionKind,
    ContinuousWalk,
    DiscreteWalk,
    WalkControl,
)
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.calls import Call
from veca_marl.sim.spec import ArraySpec

# from the lowest band of the number to the highest
BANDS = (Call.low, Call.falling, Call.none, Call.rising, Call.high)


class VoiceKind(Enum):
    """Whether an action row holds a call. `make_sound` works with either."""

    silent = "silent"
    calls = "calls"


class RowEnd(Protocol):
    """What comes after the movements in a row of numbers.

    Attributes:
        numbers: How many.
    """

    numbers: int

    def decode(self, numbers: NDArray[Any]) -> Call:
        """Return the call that they say; raise `ValueError` for an impossible one."""
        ...

    def encode(self, call: Call) -> Floats:
        """Return the numbers ``(numbers,)`` that say a call."""
        ...


class NoCall:
    """Nothing: calls are not said."""

    numbers = 0

    def decode(self, numbers: NDArray[Any]) -> Call:
        """See `RowEnd`."""
        return Call.none

    def encode(self, call: Call) -> Floats:
        """See `RowEnd`."""
        return np.empty(0)


class CallNumber:
    """A number in [-1, 1] whose band of width 0.4 is the call."""

    numbers = 1

    def decode(self, numbers: NDArray[Any]) -> Call:
        """See `RowEnd`."""
        number = float(numbers[0])
        if not -1.0 <= number <= 1.0:
            raise ValueError(f"action: the number of the call is {number}, not in [-1, 1]")
        band = int((number + 1.0) / 2.0 * len(BANDS))
        return BANDS[min(band, len(BANDS) - 1)]

    def encode(self, call: Call) -> Floats:
        """Return the middle of the call's band."""
        return np.array([(BANDS.index(call) + 0.5) / len(BANDS) * 2.0 - 1.0])


ROW_ENDS: dict[VoiceKind, RowEnd] = {
    VoiceKind.silent: NoCall(),
    VoiceKind.calls: CallNumber(),
}


class ActionControl(Protocol):
    """Turns an action row into walking and calling."""

    spec: ArraySpec

    def decode(self, row: NDArray[Any]) -> tuple[float, float, Call]:
        """Return (forward, turn, call); raise `ValueError` for an impossible row."""
        ...

    def encode(self, forward: float, turn: float, call: Call) -> NDArray[Any]:
        """Return the row that comes nearest to a wish."""
        ...


class Silent:
    """The row of a walk, without a call."""

    def __init__(self, walk: WalkControl) -> None:
        self._walk = walk
        self.spec = walk.spec

    def decode(self, row: NDArray[Any]) -> tuple[float, float, Call]:
        """See `ActionControl`."""
        return *self._walk.decode(row), Call.none

    def encode(self, forward: float, turn: float, call: Call) -> NDArray[Any]:
        """Return the walk; the call is not said."""
        return self._walk.encode(forward, turn)


class ContinuousCalls:
    """A row ``(3,)``: forward, turn, and the number of a call."""

    spec = ArraySpec((3,), np.float32, -1.0, 1.0)
    _walk, _call = ContinuousWalk(), CallNumber()

    def decode(self, row: NDArray[Any]) -> tuple[float, float, Call]:
        """See `ActionControl`."""
        if np.shape(row) != self.spec.shape:
            raise ValueError(f"action {row!r} must be the three numbers (forward, turn, call)")
        return *self._walk.decode(row[:2]), self._call.decode(row[2:])

    def encode(self, forward: float, turn: float, call: Call) -> NDArray[Any]:
        """Return the walk and the middle of the call's band."""
        walk = self._walk.encode(forward, turn)
        return np.append(walk, self._call.encode(call)).astype(np.float32)


class DiscreteCalls:
    """A scalar: ``move + 7 call``, of the moves of `DiscreteWalk` and the numbers of `Call`."""

    _walk = DiscreteWalk()
    _moves = int(_walk.spec.high) + 1
    spec = ArraySpec((), np.int64, 0, _moves * len(Call) - 1)

    def decode(self, row: NDArray[Any]) -> tuple[float, float, Call]:
        """See `ActionControl`."""
        choice = np.asarray(row)
        count = self._moves * len(Call)
        if choice.shape != () or choice.dtype.kind not in "iu" or not 0 <= choice < count:
            raise ValueError(f"action {row!r} is none of the {count} pairs of a move and a call")
        call, move = divmod(int(choice), self._moves)
        return *self._walk.decode(np.asarray(move)), Call(call)

    def encode(self, forward: float, turn: float, call: Call) -> NDArray[Any]:
        """See `ActionControl`."""
        return self._walk.encode(forward, turn) + np.asarray(self._moves * call, np.int64)


_CALLING: dict[ActionKind, ActionControl] = {
    ActionKind.continuous: ContinuousCalls(),
    ActionKind.discrete: DiscreteCalls(),
}


def action_control(action: ActionKind, voice: VoiceKind) -> ActionControl:
    """Return what reads the action rows of a walker."""
    return _CALLING[action] if voice is VoiceKind.calls else Silent(WALK_CONTROLS[action])

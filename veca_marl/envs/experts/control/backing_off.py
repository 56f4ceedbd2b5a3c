"""Getting away from what holds whoever runs into it: a wall, a door post, a corner."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from veca_marl.envs.experts.control.legs import Legs
from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.calls import Call

_HELD_S, _HELD_M, _HELD_RAD = 1.4, 0.15, 0.5  # who in so long neither goes nor turns so far is held
_BACK_S = 1.2


class BacksOff:
    """Legs that go back for a while when they got nowhere. Serves as `Legs`.

    Args:
        body: Whose they are.
        legs: How it gets about otherwise.
        step_s: Time between two wishes.

    Attributes:
        reach: See `Legs`.
    """

    def __init__(self, body: Body, legs: Legs, step_s: float) -> None:
        self.reach = legs.reach
        self._body, self._legs = body, legs
        self._held_steps, self._back_steps = round(_HELD_S / step_s), round(_BACK_S / step_s)
        self._trace: list[Floats] = []
        self._left = 0

    @property
    def goes_back(self) -> bool:
        """Whether it goes back now."""
        return self._left > 0

    def to(self, place: Floats, call: Call = Call.none) -> Any:
        """See `Legs`."""
        return self._legs.back(call) if self._is_held() else self._legs.to(place, call)

    def turn(self, left: float, call: Call = Call.none) -> Any:
        """See `Legs`."""
        return self._legs.back(call) if self._is_held() else self._legs.turn(left, call)

    def rest(self, call: Call = Call.none) -> Any:
        """See `Legs`."""
        self._trace.clear()
        return self._legs.rest(call)

    def back(self, call: Call = Call.none) -> Any:
        """See `Legs`."""
        self._trace.clear()
        return self._legs.back(call)

    def _is_held(self) -> bool:
        """Say whether it goes back in this step, from what has held it."""
        self._left = max(0, self._left - 1)
        if self._left == 0 and self._got_nowhere():
            self._trace.clear()
            self._left = self._back_steps
        return self.goes_back

    def _got_nowhere(self) -> bool:
        now = np.append(self._body.position[:2], self._body.forward[:2])
        self._trace.append(now)
        if len(self._trace) <= self._held_steps:
            return False
        then = self._trace.pop(0)
        turned = float(then[2:] @ now[2:]) < math.cos(_HELD_RAD)
        return not turned and math.dist(then[:2], now[:2]) < _HELD_M

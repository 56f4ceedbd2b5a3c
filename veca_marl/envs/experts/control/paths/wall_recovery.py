"""Recovery from walls, door posts and corners: move backwards after being stuck."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from veca_marl.envs.experts.control.locomotion import Locomotion
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import Call

# a body is stuck that has moved and turned by less than this within this time
_STUCK_S, _STUCK_M, _STUCK_RAD = 1.4, 0.15, 0.5
_BACK_S = 1.2


class WallRecovery:
    """`Locomotion` that moves backwards for 1.2 s whenever the body is stuck.

    Args:
        body: The body to watch.
        locomotion: What moves the body otherwise.
        step_s: Duration of an environment step.

    Attributes:
        clearances: See `Locomotion`.
    """

    def __init__(self, body: Body, locomotion: Locomotion, step_s: float) -> None:
        self.clearances = locomotion.clearances
        self._body, self._locomotion = body, locomotion
        self._stuck_steps, self._back_steps = round(_STUCK_S / step_s), round(_BACK_S / step_s)
        self._track: list[Floats] = []
        self._steps_left = 0

    @property
    def is_recovering(self) -> bool:
        """Whether the body moves backwards now."""
        return self._steps_left > 0

    def to(self, place: Floats, call: Call = Call.none) -> Any:
        """See `Locomotion.to`."""
        recovers = self._update()
        return self._locomotion.back(call) if recovers else self._locomotion.to(place, call)

    def turn(self, left: float, call: Call = Call.none) -> Any:
        """See `Locomotion.turn`."""
        recovers = self._update()
        return self._locomotion.back(call) if recovers else self._locomotion.turn(left, call)

    def rest(self, call: Call = Call.none) -> Any:
        """See `Locomotion.rest`."""
        self._track.clear()
        return self._locomotion.rest(call)

    def back(self, call: Call = Call.none) -> Any:
        """See `Locomotion.back`."""
        self._track.clear()
        return self._locomotion.back(call)

    def _update(self) -> bool:
        """Count one step; return whether the body moves backwards in it."""
        self._steps_left = max(0, self._steps_left - 1)
        if self._steps_left == 0 and self._is_stuck():
            self._track.clear()
            self._steps_left = self._back_steps
        return self.is_recovering

    def _is_stuck(self) -> bool:
        now = np.append(self._body.position[:2], self._body.forward[:2])
        self._track.append(now)
        if len(self._track) <= self._stuck_steps:
            return False
        before = self._track.pop(0)
        turned = float(before[2:] @ now[2:]) < math.cos(_STUCK_RAD)
        return not turned and math.dist(before[:2], now[:2]) < _STUCK_M

"""Recovery from walls, door posts and corners: move backwards after being stuck."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from veca_marl.envs.experts.control.locomotion import Locomotion
from veca_marl.envs.experts.control.paths.steering import bearing_rad
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import Call

# a body is stuck that has moved and turned by less than this within this time
_STUCK_S, _STUCK_M, _STUCK_RAD = 1.4, 0.15, 0.5
_STUCK_IN_SPACE_S = 4.0  # the same for a body with nothing near that could stop it
_BACK_S = 1.2
_ASIDE_RAD = 1.0  # a body turns towards a place at a greater angle from straight ahead


class WallRecovery:
    """`Locomotion` that moves backwards for 1.2 s whenever the body is stuck.

    Args:
        body: The body to watch.
        locomotion: What moves the body otherwise.
        step_s: Duration of an environment step.
        turning_s: Time for turning towards a place at the side or behind in which the body does not
            count as stuck. The gaits on hands and knees turn by about 20 degrees per second on the
            spot, and moving backwards would undo it.
        has_space: Returns whether nothing is near that could stop the body, which then counts as
            stuck only after 4 s; None never returns it.

    Attributes:
        clearances: See `Locomotion`.
    """

    def __init__(
        self,
        body: Body,
        locomotion: Locomotion,
        step_s: float,
        turning_s: float = 0.0,
        has_space: Callable[[], bool] | None = None,
    ) -> None:
        self.clearances = locomotion.clearances
        self._body, self._locomotion = body, locomotion
        self._stuck_steps, self._back_steps = round(_STUCK_S / step_s), round(_BACK_S / step_s)
        self._has_space, self._steps_in_space = has_space, round(_STUCK_IN_SPACE_S / step_s)
        self._track: list[Floats] = []
        self._steps_left = 0
        self._turning_steps, self._aside_steps = round(turning_s / step_s), 0

    @property
    def is_recovering(self) -> bool:
        """Whether the body moves backwards now."""
        return self._steps_left > 0

    def to(self, place: Floats, call: Call = Call.none) -> Any:
        """See `Locomotion.to`."""
        recovers = not self._is_turning(place) and self._update()
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

    def _is_turning(self, place: Floats) -> bool:
        """Count the steps for which a place has been aside; return whether there is time left."""
        is_aside = abs(bearing_rad(self._body, place)) > _ASIDE_RAD
        self._aside_steps = self._aside_steps + 1 if is_aside else 0
        return 0 < self._aside_steps < self._turning_steps and not self.is_recovering

    def _update(self) -> bool:
        """Count one step; return whether the body moves backwards in it."""
        self._steps_left = max(0, self._steps_left - 1)
        if self._steps_left == 0 and self._is_stuck():
            self._track.clear()
            self._steps_left = self._back_steps
        return self.is_recovering

    def _is_stuck(self) -> bool:
        now = np.append(self._body.position[:2], self._body.forward[:2])
        has_space = self._has_space is not None and self._has_space()
        steps = self._steps_in_space if has_space else self._stuck_steps
        self._track = [*self._track[-self._steps_in_space :], now]
        if len(self._track) <= steps:
            return False
        before = self._track[-1 - steps]
        turned = float(before[2:] @ now[2:]) < math.cos(_STUCK_RAD)
        return not turned and math.dist(before[:2], now[:2]) < _STUCK_M

"""Where a walker will be if it goes on walking and turning as it did."""

from __future__ import annotations

from collections import deque

import numpy as np

from veca_marl.envs.tasks.cars.toy_car import inside
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics.rooms import RoomCfg

_WINDOW_S = 0.4  # over which motion is averaged: single actions of a random policy say little


class Forecast:
    """Positions and headings of the last 0.4 s, and the course that continues them.

    Args:
        walker: The walker.
        room: The room that it does not leave.
        step_s: Duration of an agent step.
    """

    def __init__(self, walker: Walker, room: RoomCfg, step_s: float) -> None:
        self._walker, self._room, self._step_s = walker, room, step_s
        length = max(2, round(_WINDOW_S / step_s) + 1)
        self._seen: deque[tuple[Floats, float]] = deque(maxlen=length)

    def reset(self) -> None:
        """Forget the motion before."""
        self._seen.clear()

    def observe(self) -> None:
        """Store where the walker is. Called once per step."""
        self._seen.append((self._walker.position[:2].copy(), self._walker.yaw_rad))

    def meeting_place(self, start: Floats, speed_mps: float, longest_s: float) -> Floats:
        """Return the place at which something that starts now meets the walker.

        Args:
            start: Where it starts, ``(2,)`` or ``(3,)`` metres.
            speed_mps: Its speed, on a straight line.
            longest_s: The walker is taken to stand still after so much time.

        Returns:
            ``(2,)`` metres, within the room.
        """
        course = self._course(round(longest_s / self._step_s))
        place: Floats
        for step, place in enumerate(course):
            if horizontal_distance(start, place) <= step * self._step_s * speed_mps:
                break
        return place

    def _course(self, steps: int) -> Floats:
        """Return the present place, and those after each of the next steps, ``(1 + steps, 2)``."""
        here = self._walker.position[:2]
        before, yaw_before = self._seen[0] if self._seen else (here, self._walker.yaw_rad)
        past_s = max(1, len(self._seen) - 1) * self._step_s
        velocity = (here - before) / past_s
        turn_radps = (self._walker.yaw_rad - yaw_before) / past_s
        # the mean velocity is that of the middle of the past
        times = past_s / 2.0 + (np.arange(steps) + 0.5) * self._step_s
        cos, sin = np.cos(turn_radps * times), np.sin(turn_radps * times)
        x, y = velocity
        moves = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1) * self._step_s
        course = here + np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])
        return inside(self._room, course, self._walker.radius_m)

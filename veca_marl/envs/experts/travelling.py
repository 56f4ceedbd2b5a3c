"""Getting about in a house: through its doors, and away from what holds whoever runs into it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from veca_marl.envs.experts.legs import Legs
from veca_marl.envs.floor_plan import FloorPlan
from veca_marl.sim.bodies.base import Body
from veca_marl.sim.bodies.pushing import horizontal_distance
from veca_marl.sim.calls import Call
from veca_marl.sim.pose import Floats

NEAR_M = 0.4  # a place so near is reached
_HELD_S, _HELD_M, _HELD_RAD = 1.4, 0.15, 0.5  # who in so long neither goes nor turns so far is held
_BACK_S = 1.2


class Traveller:
    """One who knows its place in a house.

    Args:
        body: Its body, whose place and heading it knows.
        legs: How it gets about.
        plan: The rooms and doors it knows.
        step_s: Time between two wishes.
    """

    def __init__(self, body: Body, legs: Legs, plan: FloorPlan, step_s: float) -> None:
        self._body, self._legs, self._plan = body, legs, plan
        self._beyond: Floats | None = None
        self._trace: list[Floats] = []
        self._held_steps, self._back_steps = round(_HELD_S / step_s), round(_BACK_S / step_s)
        self._steps_back = 0

    @property
    def room(self) -> int:
        """The number of the room it is in."""
        return self._plan.room_of(self._body.position)

    def is_at(self, place: Floats) -> bool:
        """Say whether a place ``(2,)`` or ``(3,)`` is reached."""
        return horizontal_distance(place, self._body.position) < NEAR_M

    def to(self, goal: Floats, call: Call = Call.none) -> Any:
        """Go to a place anywhere in the house, ``(2,)`` or ``(3,)``; call on the way."""
        point = self._next(goal)
        return self._back(call) or self._legs.to(point, call)

    def look_round(self, call: Call = Call.none) -> Any:
        """Turn to the left where it is."""
        return self._back(call) or self._legs.turn(1.0, call)

    def rest(self, call: Call = Call.none) -> Any:
        """Stay."""
        self._trace.clear()
        return self._legs.rest(call)

    def _next(self, goal: Floats) -> Floats:
        """Return where to go straight to: who goes through a door goes on until it is through."""
        if self._beyond is not None and not self.is_at(self._beyond):
            return self._beyond
        point = self._plan.waypoint(self._body.position, goal, self._legs.reach.passing)
        self._beyond = None if self._plan.room_of(point) == self.room else point
        return point

    def _back(self, call: Call) -> Any:
        """Return the wish of who has gone nowhere for a while and now goes back; else None."""
        if self._steps_back == 0 and self._is_held():
            self._trace.clear()
            self._steps_back, self._beyond = self._back_steps, None
        if self._steps_back == 0:
            return None
        self._steps_back -= 1
        return self._legs.back(call)

    def _is_held(self) -> bool:
        now = np.append(self._body.position[:2], self._body.forward[:2])
        self._trace.append(now)
        if len(self._trace) <= self._held_steps:
            return False
        then = self._trace.pop(0)
        turned = float(then[2:] @ now[2:]) < math.cos(_HELD_RAD)
        return not turned and math.dist(then[:2], now[:2]) < _HELD_M

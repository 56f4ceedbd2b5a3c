"""Getting about in a house, through its doors."""

from __future__ import annotations

from typing import Any

from veca_marl.envs.experts.control.backing_off import BacksOff
from veca_marl.envs.experts.control.legs import Legs
from veca_marl.envs.tasks.multi_agent.floor_plan import FloorPlan
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.walker.pushing import horizontal_distance
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.calls import Call

_NEAR_M = 0.4  # a place so near is reached


class Traveller:
    """One who knows its place in a house.

    Args:
        body: Its body, whose place and heading it knows.
        legs: How it gets about.
        plan: The rooms and doors it knows.
        step_s: Time between two wishes.
    """

    def __init__(self, body: Body, legs: Legs, plan: FloorPlan, step_s: float) -> None:
        self._body, self._plan = body, plan
        self._legs = BacksOff(body, legs, step_s)
        self._beyond: Floats | None = None

    @property
    def room(self) -> int:
        """The number of the room it is in."""
        return self._plan.room_of(self._body.position)

    def is_at(self, place: Floats) -> bool:
        """Say whether a place ``(2,)`` or ``(3,)`` is reached."""
        return horizontal_distance(place, self._body.position) < _NEAR_M

    def to(self, goal: Floats, call: Call = Call.none) -> Any:
        """Go to a place anywhere in the house, ``(2,)`` or ``(3,)``; call on the way."""
        return self._legs.to(self._next(goal), call)

    def look_round(self, call: Call = Call.none) -> Any:
        """Turn to the left where it is."""
        return self._legs.turn(1.0, call)

    def rest(self, call: Call = Call.none) -> Any:
        """Stay."""
        return self._legs.rest(call)

    def _next(self, goal: Floats) -> Floats:
        """Return where to go straight to: who goes through a door goes on until it is through."""
        beyond = self._beyond
        if beyond is not None and not self.is_at(beyond) and not self._legs.goes_back:
            return beyond
        point = self._plan.waypoint(self._body.position, goal, self._legs.reach.passing)
        self._beyond = None if self._plan.room_of(point) == self.room else point
        return point

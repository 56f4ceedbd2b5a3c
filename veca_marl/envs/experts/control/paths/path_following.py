"""Path following: move to any point of a house, through its doors."""

from __future__ import annotations

from typing import Any

from veca_marl.envs.experts.control.locomotion import Locomotion
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.experts.control.paths.furniture_detours import Detours, StraightWays
from veca_marl.envs.tasks.floors.floor_plan import FloorPlan
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.sound import Call

_ARRIVED_M = 0.4


class PathFollower:
    """Moves a body along the shortest path through a known floor plan.

    Args:
        body: The body; its position and heading are read from the simulator.
        locomotion: What moves the body.
        plan: Rooms and doors.
        step_s: Duration of an environment step.
        detours: Ways between the points of the path.
    """

    def __init__(
        self,
        body: Body,
        locomotion: Locomotion,
        plan: FloorPlan,
        step_s: float,
        detours: Detours | None = None,
    ) -> None:
        self._body, self._plan = body, plan
        self._detours = StraightWays() if detours is None else detours
        self._locomotion = WallRecovery(body, locomotion, step_s)
        self._beyond_door: Floats | None = None

    @property
    def room(self) -> int:
        """Number of the room that the body is in."""
        return self._plan.room_of(self._body.position)

    def is_at(self, place: Floats) -> bool:
        """Return whether the body is within 0.4 m of a place, ``(2,)`` or ``(3,)`` metres."""
        return horizontal_distance(place, self._body.position) < _ARRIVED_M

    def to(self, goal: Floats, call: Call = Call.none) -> Any:
        """Move towards a place anywhere in the house; arguments as in `Locomotion.to`."""
        waypoint = self._waypoint(goal)
        point = self._detours.next_point(self._body.position, waypoint)
        return self._locomotion.to(point, call)

    def turn_left(self, call: Call = Call.none) -> Any:
        """Turn to the left on the spot."""
        return self._locomotion.turn(1.0, call)

    def rest(self, call: Call = Call.none) -> Any:
        """Stay."""
        return self._locomotion.rest(call)

    def _waypoint(self, goal: Floats) -> Floats:
        """Return the next point to steer to, ``(2,)`` metres.

        A point behind a door is kept until it is reached, so that a body does not stop inside the
        opening.
        """
        beyond = self._beyond_door
        if beyond is not None and not self.is_at(beyond) and not self._locomotion.is_recovering:
            return beyond
        approach = self._locomotion.clearances.door_approach
        point = self._plan.waypoint(self._body.position, goal, approach)
        self._beyond_door = None if self._plan.room_of(point) == self.room else point
        return point

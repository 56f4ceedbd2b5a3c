"""Path following: through doors to any point of a house, round furniture, away from walls."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from veca_marl.envs.experts.control.locomotion import Locomotion, bearing_rad
from veca_marl.envs.tasks.floors.floor_plan import FloorPlan
from veca_marl.envs.tasks.floors.grid_paths import CELL_M, PathsTo, floor_grid, free_cells
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, World
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

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()

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


_GREATEST_CLEARANCE_M = 0.3  # half of a door 1 m wide, less the cells that a path needs
_OPEN = 0.5  # a leaf that is further open leaves room to walk through


class Detours(Protocol):
    """Ways to waypoints of a path."""

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """Return the next point ``(2,)`` of the way from a place to a waypoint, metres."""
        ...


class StraightWays:
    """No detours: for floors without furniture in the way."""

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """See `Detours`."""
        return waypoint


class FurnitureDetours:
    """Shortest ways that keep a distance from walls and furniture.

    Toys and closed doors are walked into, and move. An open door is walked round: a body that comes
    from behind its leaf would close it, and a leaf that opens towards the body stays closed.

    Args:
        world: The world; its props are where they are now.
        clear_m: Least distance, limited so that doors are passable.
    """

    def __init__(self, world: World, clear_m: float) -> None:
        self._grid = floor_grid(world.playground)
        moved = [prop for prop in world.props.values() if _is_pushed_away(prop)]
        limited_m = min(clear_m, _GREATEST_CLEARANCE_M)
        self._free = free_cells(self._grid, world, limited_m, passable=moved)
        self._paths: tuple[Floats, PathsTo] | None = None

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """See `Detours`."""
        known = self._paths
        if known is None or horizontal_distance(waypoint, known[0]) > CELL_M:
            known = np.array(waypoint), PathsTo(self._grid, self._free, waypoint)
            self._paths = known
        return known[1].next_point(place)


def _is_pushed_away(prop: Prop) -> bool:
    if prop.joint is None:
        return not prop.fixed
    return prop.opening < _OPEN


def detours_in(world: World, clear_m: float) -> Detours:
    """Return ways round furniture in a furnished playground, else straight ones."""
    return FurnitureDetours(world, clear_m) if world.playground.furniture else StraightWays()


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

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()

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

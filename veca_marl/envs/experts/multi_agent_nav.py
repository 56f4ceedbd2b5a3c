"""Search for an object in a house: call when it is found, go to calls of others."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.experts.control.locomotion import Locomotion
from veca_marl.envs.experts.control.paths.furniture_detours import detours_in
from veca_marl.envs.experts.control.paths.path_following import PathFollower
from veca_marl.envs.experts.perception.call_localization import CallSourceMap
from veca_marl.envs.tasks.floors.floor_plan import FloorPlan
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World
from veca_marl.sim.sound import Call

CALL = Call.high
_LISTEN_S = 0.2  # time between two updates of the estimated position of callers
_SCAN_RAD = math.radians(330.0)  # this turn shows the whole room to eyes with a field of view of 60


class ObjectSearch:
    """Commands of one agent in MultiAgentNav.

    Args:
        body: The body; its position and heading are read from the simulator.
        locomotion: What moves the body.
        plan: Rooms and doors.
        world: The world, for its walls.
        noise_power: Squared magnitude of the ears' own noise in a bin.
    """

    def __init__(
        self,
        body: Body,
        locomotion: Locomotion,
        plan: FloorPlan,
        world: World,
        noise_power: float = 0.0,
    ) -> None:
        step_s = world.clock.step_s
        self._body, self._plan = body, plan
        detours = detours_in(world, locomotion.clearances.wall_m)
        self._path = PathFollower(body, locomotion, plan, step_s, detours)
        self._calls = CallSourceMap(world, noise_power)
        self._listen_steps, self._steps = max(1, round(_LISTEN_S / step_s)), 0
        self._found: Floats | None = None
        self._goal = body.position
        self._scan_left_rad, self._heading = _SCAN_RAD, body.forward
        self._searched: set[int] = set()

    def command(self, audio: NDArray[Any] | None, seen: Floats | None, arrived: bool) -> Any:
        """Return the command for the next step. Called once per step.

        Args:
            audio: The observation ``audio``, ``(2, 250)``, or None without hearing.
            seen: Position of the object, ``(3,)`` metres, if it is visible, else None.
            arrived: Whether the agent has reached the object.
        """
        turned_rad = self._turned_rad()
        if seen is not None:
            self._found = seen
        if self._found is not None:
            return self._approach_and_call(self._found, arrived)
        self._listen(audio)
        return self._search(turned_rad)

    def _approach_and_call(self, found: Floats, arrived: bool) -> Any:
        call = CALL if self._path.room == self._plan.room_of(found) else Call.none
        if not arrived:
            return self._path.to(found, call)
        waiting_place = self._plan.waiting_place(found)
        there = self._path.is_at(waiting_place)
        return self._path.rest(call) if there else self._path.to(waiting_place, call)

    def _listen(self, audio: NDArray[Any] | None) -> None:
        if audio is not None and self._steps % self._listen_steps == 0:
            first = not self._calls.heard
            self._calls.update(self._body.mount("head"), audio)
            if first and self._calls.heard:
                self._scan_left_rad = 0.0  # stop scanning and go to the caller
        self._steps += 1

    def _search(self, turned_rad: float) -> Any:
        """Go to the estimated position of a caller; without calls, scan room after room."""
        if self._scan_left_rad > 0.0:
            self._scan_left_rad -= turned_rad
            if self._scan_left_rad <= 0.0:
                self._goal = self._next_room_middle()
            return self._path.turn_left()
        goal = self._calls.best() if self._calls.heard else self._goal
        if self._path.is_at(goal):
            self._scan_left_rad = _SCAN_RAD
        return self._path.to(goal)

    def _turned_rad(self) -> float:
        """Return the change of heading since the last command, positive to the left."""
        before, self._heading = self._heading, self._body.forward
        across = before[0] * self._heading[1] - before[1] * self._heading[0]
        return math.atan2(across, float(before @ self._heading))

    def _next_room_middle(self) -> Floats:
        """Return the middle of the nearest unsearched room; restart when all are searched."""
        here = self._path.room
        self._searched.add(here)
        rooms = range(len(self._plan.rooms))
        if self._searched.issuperset(rooms):
            self._searched = {here}
        unsearched = [room for room in rooms if room not in self._searched]
        nearest = min(unsearched, key=lambda room: self._plan.distance_m(here, room))
        return self._plan.rooms[nearest].middle_m

"""Seeking an object through a house, calling when it is found and coming when it is called."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.experts.legs import Legs
from veca_marl.envs.floor_plan import FloorPlan
from veca_marl.sim.bodies.base import Body
from veca_marl.sim.bodies.pushing import horizontal_distance
from veca_marl.sim.calls import Call
from veca_marl.sim.pose import Floats
from veca_marl.sim.world import World

CALL = Call.high
_HEARD = -5.0  # log10 of a magnitude; a call through three walls has -4, silence -8
_SAME = 0.1  # difference of the ears that is worth a full turn, log10; a call 10 degrees aside
_FACING_STEPS = 8  # a caller behind is as loud in both ears, but not for so long
_AT_1_M = 1.7  # log10 of the greatest magnitude of a call at 1 m without a room, as measured
_FARTHEST_M = 20.0
_BELIEVED_STEPS = 75  # then it listens again
_NEAR_M = 0.4  # a place so near is reached
_ROUND_RAD = math.radians(330.0)  # a turn that shows the whole room to eyes of 60 degrees


class Seeker:
    """One player of MultiAgentNav.

    Args:
        body: Its body, whose place and heading it knows.
        legs: How it gets about.
        plan: The rooms and doors it knows.
        world: Whose walls it knows.
    """

    def __init__(self, body: Body, legs: Legs, plan: FloorPlan, world: World) -> None:
        self._body, self._legs, self._plan, self._world = body, legs, plan, world
        self._found: Floats | None = None
        self._caller: Floats | None = None
        self._believed_steps = self._facing_steps = 0
        self._spot: Floats | None = None
        self._turned_rad, self._heading = 0.0, body.forward
        self._searched: set[int] = set()

    def wish(self, audio: NDArray[Any] | None, seen: Floats | None) -> Any:
        """Say what to do next.

        Args:
            audio: The observation ``(2, 250)``, or None for the deaf.
            seen: ``(3,)`` where the object is seen, or None.
        """
        turned_rad = self._turned_since()
        if seen is not None:
            self._found = seen
        if self._found is not None:
            return self._go_and_call(self._found)
        if self._caller is not None and self._believed_steps > 0:
            self._believed_steps -= 1
            if not self._is_at(self._caller):
                return self._go(self._caller)
        self._caller = None
        if audio is not None and audio.max() > _HEARD:
            return self._listen(audio)
        return self._search(turned_rad)

    def _go_and_call(self, found: Floats) -> Any:
        room = self._plan.room_of(self._body.position)
        call = CALL if room == self._plan.room_of(found) else Call.none
        return self._go(found, call)

    def _go(self, goal: Floats, call: Call = Call.none) -> Any:
        return self._legs.to(self._plan.waypoint(self._body.position, goal), call)

    def _is_at(self, place: Floats) -> bool:
        return horizontal_distance(place, self._body.position) < _NEAR_M

    def _listen(self, audio: NDArray[Any]) -> Any:
        """Turn to the louder ear; once both hear the same, believe the caller straight ahead."""
        left, right = loudness(audio)
        turn = min(max((left - right) / _SAME, -1.0), 1.0)
        self._facing_steps = self._facing_steps + 1 if abs(turn) < 0.6 else 0
        if self._facing_steps == _FACING_STEPS:
            self._caller = self._place_ahead(float(audio.max()))
            self._believed_steps, self._facing_steps = _BELIEVED_STEPS, 0
            self._turned_rad, self._spot = 0.0, None
        return self._legs.turn(turn)

    def _place_ahead(self, level: float) -> Floats:
        """Return from where straight ahead, in a room, a call would be as loud as heard."""
        ears, ahead = self._body.mount("head").position, self._body.forward
        loss = self._world.playground.transmission_loss_db / 20.0
        best, least = ears + _NEAR_M * ahead, math.inf
        for away_m in np.arange(_NEAR_M, _FARTHEST_M, 0.2):
            place = ears + away_m * ahead
            if not any(room.contains(place) for room in self._plan.rooms):
                continue
            walls = self._world.house.walls_between(ears, place)
            off = abs(_AT_1_M - math.log10(away_m) - loss * walls - level)
            if off < least:
                best, least = place, off
        return best

    def _search(self, turned_rad: float) -> Any:
        """Turn round once in the middle of each room, but first where it starts."""
        if self._spot is not None and not self._is_at(self._spot):
            return self._go(self._spot)
        self._turned_rad += turned_rad
        if self._turned_rad >= _ROUND_RAD:
            self._turned_rad = 0.0
            self._spot = self._next_spot()
        return self._legs.turn(1.0)

    def _turned_since(self) -> float:
        """Return how far it has turned since the last wish, rad, left is positive."""
        before, self._heading = self._heading, self._body.forward
        across = before[0] * self._heading[1] - before[1] * self._heading[0]
        return math.atan2(across, float(before @ self._heading))

    def _next_spot(self) -> Floats:
        """Return the middle of the nearest room that was not searched; at last begin anew."""
        here = self._plan.room_of(self._body.position)
        self._searched.add(here)
        rooms = range(len(self._plan.rooms))
        if self._searched.issuperset(rooms):
            self._searched = {here}
        left = [room for room in rooms if room not in self._searched]
        nearest = min(left, key=lambda room: self._plan.distance_m(here, room))
        return self._plan.rooms[nearest].middle_m


def loudness(audio: NDArray[Any]) -> Floats:
    """Return log10 of the root of each ear's energy, ``(2,)``, from the observation."""
    energy = (10.0 ** (2.0 * audio.astype(np.float64))).sum(axis=1)
    level: Floats = np.log10(energy) / 2.0
    return level

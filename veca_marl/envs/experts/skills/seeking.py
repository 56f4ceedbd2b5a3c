"""Seeking an object through a house, calling when it is found and coming when it is called."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.experts.control.legs import Legs
from veca_marl.envs.experts.control.travelling import Traveller
from veca_marl.envs.experts.perception.hearing import CallMap
from veca_marl.envs.tasks.multi_agent.floor_plan import FloorPlan
from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.world import World
from veca_marl.sim.sound.calls import Call

CALL = Call.high
_LISTEN_S = 0.2  # it takes in what it hears every so often
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
        step_s = world.clock.step_s
        self._body, self._plan = body, plan
        self._traveller = Traveller(body, legs, plan, step_s)
        self._calls = CallMap(world)
        self._every, self._steps = max(1, round(_LISTEN_S / step_s)), 0
        self._found: Floats | None = None
        self._spot = body.position
        self._to_turn_rad, self._heading = _ROUND_RAD, body.forward
        self._searched: set[int] = set()

    def wish(self, audio: NDArray[Any] | None, seen: Floats | None, arrived: bool) -> Any:
        """Say what to do next.

        Args:
            audio: The observation ``(2, 250)``, or None for the deaf.
            seen: ``(3,)`` where the object is seen, or None.
            arrived: Whether it has come to the object.
        """
        turned_rad = self._turned_since()
        if seen is not None:
            self._found = seen
        if self._found is not None:
            return self._go_and_call(self._found, arrived)
        self._listen(audio)
        return self._seek(turned_rad)

    def _go_and_call(self, found: Floats, arrived: bool) -> Any:
        call = CALL if self._traveller.room == self._plan.room_of(found) else Call.none
        if not arrived:
            return self._traveller.to(found, call)
        aside = self._plan.aside_of(found)
        there = self._traveller.is_at(aside)
        return self._traveller.rest(call) if there else self._traveller.to(aside, call)

    def _listen(self, audio: NDArray[Any] | None) -> None:
        if audio is not None and self._steps % self._every == 0:
            silent = not self._calls.heard
            self._calls.hear(self._body.mount("head"), audio)
            if silent and self._calls.heard:
                self._to_turn_rad = 0.0  # it goes at once
        self._steps += 1

    def _seek(self, turned_rad: float) -> Any:
        """Look round where a call comes from; in silence, once in each room from here on."""
        if self._to_turn_rad > 0.0:
            self._to_turn_rad -= turned_rad
            if self._to_turn_rad <= 0.0:
                self._spot = self._next_spot()
            return self._traveller.look_round()
        goal = self._calls.best() if self._calls.heard else self._spot
        if self._traveller.is_at(goal):
            self._to_turn_rad = _ROUND_RAD
        return self._traveller.to(goal)

    def _turned_since(self) -> float:
        """Return how far it has turned since the last wish, rad, left is positive."""
        before, self._heading = self._heading, self._body.forward
        across = before[0] * self._heading[1] - before[1] * self._heading[0]
        return math.atan2(across, float(before @ self._heading))

    def _next_spot(self) -> Floats:
        """Return the middle of the nearest room that was not searched; at last begin anew."""
        here = self._traveller.room
        self._searched.add(here)
        rooms = range(len(self._plan.rooms))
        if self._searched.issuperset(rooms):
            self._searched = {here}
        left = [room for room in rooms if room not in self._searched]
        nearest = min(left, key=lambda room: self._plan.distance_m(here, room))
        return self._plan.rooms[nearest].middle_m

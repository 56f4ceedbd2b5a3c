"""Expert of MultiAgentNav: search, call when the object is found, locate callers and go to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import Locomotion, locomotion_of
from veca_marl.envs.experts.control.path_following import PathFollower, detours_in
from veca_marl.envs.tasks.floors.floor_plan import FloorPlan
from veca_marl.envs.tasks.navigation.multi_agent_nav import MultiAgentNav
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing import AudioSense, Noise
from veca_marl.sim.physics import RoomCfg, World
from veca_marl.sim.sound import Call
from veca_marl.sim.sound.surroundings import Arrivals

# Levels are log10 of the root of an ear's energy, measured by experiments/calling/ears.py (walkers
# 1.85 and 0.40, crawlers 1.88 and 0.39). The standard deviations are larger than measured at rest,
# since callers and listeners move.
_LEVEL_AT_1_M = 1.86  # mean of both ears, where the direct sound at 1 m is all that arrives
_ILD = 0.40  # interaural level difference of a call from the side
_LEVEL_STD, _ILD_STD = 0.15, 0.15
_GRID_M = 0.4
_MEMORY = 0.95  # decay of the log-likelihood per update, since callers move
_LEAST_ENERGY = 1e-16  # of an ear that hears nothing beside its noise
_BANDS = slice(2, 6)  # octaves from 500 Hz to 4 kHz, those of the calls
_AUDIBLE = -5.0  # a call through three walls reaches -4, silence is at -8


def arrival_of(arrivals: Arrivals) -> tuple[float, float]:
    """Return log10 of the pressure of a call, 0 for the direct sound at 1 m, and its direction.

    The direction is the sine of the azimuth, positive to the left, the mean by energy.
    """
    energy = arrivals.energy()[:, _BANDS].mean(axis=1)
    total = max(float(energy.sum()), _LEAST_ENERGY)
    left = arrivals.vectors[:, 1] / np.linalg.norm(arrivals.vectors, axis=1)
    return math.log10(total) / 2.0, float(energy @ left) / total


class CallSourceMap:
    """Log-likelihood of the position of a caller on a grid over a house.

    A listener knows its own head pose and the acoustics of the house. One heading leaves open
    whether a call comes from the front or from behind; two headings resolve it.

    Args:
        world: The world, for its rooms and walls.
        noise_power: Squared magnitude of the receivers' own noise in a bin, which is no call, see
            `AudioSense.noise_power`.

    Attributes:
        heard: Whether a call has been heard.
    """

    def __init__(self, world: World, noise_power: Noise = 0.0) -> None:
        self._world = world
        self._noise_power = noise_power
        self._audible = max(10.0 ** (2.0 * _AUDIBLE), float(np.max(noise_power)))
        self._places = np.concatenate([_grid(room) for room in world.playground.rooms])
        self._log_likelihood = np.zeros(len(self._places))
        self.heard = False

    def update(self, head: Pose, audio: NDArray[Any]) -> None:
        """Update the map with what the ears hear now; silence leaves it unchanged.

        Args:
            head: Pose of the listener's head.
            audio: ``(2, bins)`` log10 of magnitudes, see `AudioSense.log_magnitudes`.
        """
        power = sound_power(audio, self._noise_power)
        if power.max() < self._audible:
            return
        left, right = loudness(power)
        self._places[:, 2] = head.position[2]  # assumes mouths at the height of these ears
        levels, lefts = self._expected(head)
        level_error = (_LEVEL_AT_1_M + levels - (left + right) / 2.0) / _LEVEL_STD
        ild_error = (_ILD * lefts - (left - right)) / _ILD_STD
        self._log_likelihood *= _MEMORY
        self._log_likelihood -= (level_error**2 + ild_error**2) / 2.0
        self.heard = True

    def best(self) -> Floats:
        """Return the most likely position of a caller, ``(3,)`` metres."""
        place: Floats = self._places[int(np.argmax(self._log_likelihood))]
        return place

    def _expected(self, head: Pose) -> tuple[Floats, Floats]:
        """Return level and direction of a call from each place by all paths, see `arrival_of`."""
        arrivals = [self._world.house.arrivals(place, head) for place in self._places]
        levels, lefts = np.array([arrival_of(each) for each in arrivals]).T
        return np.minimum(levels, -math.log10(_GRID_M)), lefts


def _grid(room: RoomCfg) -> Floats:
    """Return places on a grid over a room's floor, ``(n, 3)`` metres."""
    x, y = (
        np.arange(low + _GRID_M / 2.0, low + size, _GRID_M)
        for low, size in zip(room.lower_m[:2], room.size_m[:2], strict=True)
    )
    return np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3)


def sound_power(audio: NDArray[Any], noise_power: Noise = 0.0) -> Floats:
    """Return the squared magnitudes of what is heard, ``(2, bins)``.

    Args:
        audio: ``(2, bins)`` log10 of magnitudes, see `AudioSense.log_magnitudes`.
        noise_power: Squared magnitude of the receivers' own noise in a bin.
    """
    power: Floats = np.maximum(10.0 ** (2.0 * audio.astype(np.float64)) - noise_power, 0.0)
    return power


def loudness(power: Floats) -> Floats:
    """Return log10 of the root of each ear's energy, ``(2,)``.

    Args:
        power: Squared magnitudes, ``(2, 250)``, not all 0.
    """
    level: Floats = np.log10(np.maximum(power.sum(axis=1), _LEAST_ENERGY)) / 2.0
    return level


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
        noise_power: Noise = 0.0,
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

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._path.follow_body()

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


@register_expert("MultiAgentNav")
class MultiAgentNavExpert(Expert[MultiAgentNav]):
    """Searches the house, calls beside the object, and goes to where calls come from.

    An agent that has seen the object knows its position, goes there, calls while it is in the same
    room, and after its arrival makes space for the others. An agent that has not seen it estimates
    the position of callers from the observation ``audio``: the level falls with distance, by 30 dB
    for each wall, and differs between the ears with the direction. Without calls it turns round
    once in each room, the nearest first. An agent that is stuck moves backwards.

    Reads privileged state: its own position and heading, the floor plan, the positions of walls,
    doors and things, and whether the object is visible, where it then is, and which agents have
    reached it. A crawling body needs up to a minute where a walker needs ten seconds.
    """

    reads = ("audio",)

    def reset(self) -> None:
        """See `Expert.reset`."""
        body, world = self.player.body, self.task.world
        locomotion = locomotion_of(self.player, world.clock.step_s)
        ears = self.player.senses.get("audio")
        self._ears = ears if isinstance(ears, AudioSense) else None
        noise_power: Noise = 0.0 if self._ears is None else self._ears.noise_power
        self._search = ObjectSearch(body, locomotion, self.task.plan, world, noise_power)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        task, player = self.task, self.player
        seen = task.target.position if task.sees_target(player) else None
        audio = None if self._ears is None else self._ears.log_magnitudes(observation["audio"])
        return self._search.command(audio, seen, player.name in task.arrived)

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._search.follow_body()

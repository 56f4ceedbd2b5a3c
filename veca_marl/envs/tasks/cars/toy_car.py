"""A toy car that drives by itself from one random point of a room to the next."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from veca_marl.envs.tasks.floors.places import Clearances
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import ClockCfg, PropCfg, PropShape, World
from veca_marl.sim.physics.props.prop_cfg import PartCfg
from veca_marl.sim.physics.rooms import RoomCfg
from veca_marl.sim.sound import SoundCfg

LENGTH_M, WIDTH_M, HEIGHT_M = 0.34, 0.2, 0.16
_WHEEL_M, _TYRE_M = 0.04, 0.03  # radius and width of a wheel
_CHASSIS_M = 0.07  # height
_GLASS, _RUBBER = (0.25, 0.35, 0.45), (0.1, 0.1, 0.1)


def car_parts() -> list[PartCfg]:
    """Return the parts, front along x, with the middle of the bounding box at the origin."""
    low_m = -HEIGHT_M / 2.0
    chassis_z = low_m + 0.5 * _WHEEL_M + _CHASSIS_M / 2.0
    cabin_m = HEIGHT_M / 2.0 - (chassis_z + _CHASSIS_M / 2.0)
    parts = [
        PartCfg(PropShape.box, [LENGTH_M, WIDTH_M - 2.0 * _TYRE_M, _CHASSIS_M], (0, 0, chassis_z)),
        PartCfg(
            PropShape.box,
            [0.45 * LENGTH_M, 0.6 * WIDTH_M, cabin_m],
            (-0.12 * LENGTH_M, 0.0, HEIGHT_M / 2.0 - cabin_m / 2.0),
            colour=_GLASS,
        ),
    ]
    for x in (-0.3 * LENGTH_M, 0.3 * LENGTH_M):
        for y in (-(WIDTH_M - _TYRE_M) / 2.0, (WIDTH_M - _TYRE_M) / 2.0):
            parts.append(
                PartCfg(
                    PropShape.cylinder,
                    [_WHEEL_M, _TYRE_M],
                    (x, y, low_m + _WHEEL_M),
                    (90.0, 0.0, 0.0),
                    _RUBBER,
                )
            )
    return parts


_MASS_KG = 2.0  # below the push limit of walkers: it is pushed away and displaces none
_COLOUR = (0.95, 0.75, 0.1)
ARRIVED_M = 0.15
_PATIENCE_S = 6.0  # after which a point that has not been reached is given up
_DRAWS = 30
SLOWEST = 0.2  # share of the speed while it turns
_HALF_M = math.hypot(LENGTH_M, WIDTH_M) / 2.0  # of its diagonal
_ROOM_TO_TURN_M = LENGTH_M / 2.0 + 0.05  # to the walls, from places where it stops
_HEIGHTS_M = np.array([0.05, HEIGHT_M])  # at which it can hit something
_TIPPED = 0.9  # cosine of the inclination from which the car is set upright

DrawPoint: TypeAlias = Callable[[np.random.Generator], Floats]
"""Draws a point of the floor, ``(2,)`` or ``(3,)`` metres, to drive to."""


def inside(room: RoomCfg, points: Floats, margin_m: float) -> Floats:
    """Return the points of a room that are nearest to some points.

    Args:
        room: The room.
        points: ``(..., 2)`` metres.
        margin_m: Least distance to the walls.

    Returns:
        ``(..., 2)`` metres.
    """
    low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
    return np.clip(points, low + margin_m, low + size - margin_m)


def check_speed(speed_mps: float, clock: ClockCfg) -> None:
    """Check that a car moves by at most half its length in one physics step.

    Contacts are found after each physics step: a faster car could pass through a player or a wall
    without a contact.

    Raises:
        ValueError: If it is faster; the message names the limit.
    """
    limit = LENGTH_M / 2.0 / clock.substep_s
    if speed_mps > limit:
        raise ValueError(
            f"task.speed_mps={speed_mps} covers more than half the length of the car, "
            f"{LENGTH_M / 2.0:.2f} m, in a physics step of {clock.substep_s:.4g} s: at most "
            f"{limit:.4g} m/s, or raise clock.substeps"
        )


class Motion(NamedTuple):
    """How a car drives.

    Attributes:
        speed_mps: Speed on a straight line.
        turn_radps: Greatest turning speed.
    """

    speed_mps: float
    turn_radps: float

    def towards(
        self, point: Floats, place: Floats, heading_rad: float, step_s: float
    ) -> tuple[float, float]:
        """Return the speed (m/s) and the turning speed (rad/s) of a step towards a point."""
        bearing = math.atan2(point[1] - place[1], point[0] - place[0]) - heading_rad
        bearing = math.remainder(bearing, 2.0 * math.pi)
        turn = min(max(bearing / step_s, -self.turn_radps), self.turn_radps)
        return self.speed_mps * max(math.cos(bearing), SLOWEST), turn


class ToyCar:
    """A car that drives in straight lines between points that it draws.

    Its velocity is set at the start of each agent step; collisions are those of the physics. It
    turns towards a point with at most `Motion.turn_radps` and drives with the cosine of the
    bearing, at least 0.2, so that it turns nearly on the spot. A drawn point is reachable if the
    straight line to it is clear of props by half the diagonal of the car, or, if there is no such
    point, by half its width. It is replaced when it is reached, or after 6 s.

    Args:
        world: A world that is not frozen.
        motion: How it drives.
        sound: What it sounds like while the episode lasts.
        interactions: Names of the verbs that can be applied to it, see `PropCfg.interactions`.

    Attributes:
        prop: The car, its front along x, see `car_parts`.
        room: The room in which it drives: the first one of the playground.
        motion: How it drives.
        point: The point that it drives to, ``(2,)`` metres.
    """

    def __init__(
        self, world: World, motion: Motion, sound: SoundCfg, interactions: Sequence[str] = ()
    ) -> None:
        self.room = world.playground.rooms[0]
        self.motion, self._step_s = motion, world.clock.step_s
        self._obstacles = [p for p in world.props.values() if p.cfg.tangible]
        self.prop = world.add_prop(
            PropCfg(
                name="toy_car",
                shape=PropShape.compound,
                parts=car_parts(),
                mass_kg=_MASS_KG,
                friction=0.0,  # it rolls: its velocity is that of its drive
                rolling_friction=0.0,
                restitution=0.0,
                colour=_COLOUR,
                sound=sound,
                interactions=list(interactions),
            )
        )
        self._resting_m = self.room.lower_m[2] + HEIGHT_M / 2.0
        self.point = np.zeros(2)
        self._left_s = 0.0

    @property
    def needs_point(self) -> bool:
        """Whether the point has been reached or given up, so that `drive` will draw another."""
        is_there = math.dist(self.prop.position[:2], self.point) < ARRIVED_M
        return self._left_s <= 0.0 or is_there

    @property
    def heading_rad(self) -> float:
        """Direction of its front."""
        x, y = self.prop.rotation[:2, 0]
        return math.atan2(y, x)

    def reset(self, place: Floats, rng: np.random.Generator) -> None:
        """Stand at a place of the floor with a random heading."""
        self.prop.place((place[0], place[1], self._resting_m), rng.uniform(-math.pi, math.pi))
        self.point, self._left_s = np.array(place[:2]), 0.0

    def drive(self, draw: DrawPoint, rng: np.random.Generator) -> None:
        """Set the velocity of the next step. Called before the physics of each step.

        Args:
            draw: Draws the next point when the car needs one.
            rng: Random generator of the episode.
        """
        self._set_upright()
        if self.needs_point:
            self.drive_to(self._reachable_point(draw, rng))
        self._left_s -= self._step_s
        heading = self.heading_rad
        speed, turn = self.motion.towards(self.point, self.prop.position, heading, self._step_s)
        ahead = speed * math.cos(heading), speed * math.sin(heading)
        self.prop.set_velocity((*ahead, self._vertical_mps()), (0.0, 0.0, turn))

    def drive_to(self, point: Floats) -> None:
        """Drive to a point ``(2,)`` of the floor from now on.

        If the last point has not been reached, the time until the car gives up goes on: a car that
        is stuck has to get another point, also while its point is corrected.
        """
        if self.needs_point:
            self._left_s = _PATIENCE_S
        self.point = point

    def fits_between(self, start: Floats, end: Floats) -> bool:
        """Return whether no prop obstructs the car on a straight line.

        A body that is wider than the car, such as the default walker, stands at no place where the
        end of a line is obstructed.

        Args:
            start: ``(2,)`` metres.
            end: ``(2,)`` metres.
        """
        clearances = Clearances(self._obstacles, _HEIGHTS_M)
        return clearances.all_at_least(_line(start, end), WIDTH_M / 2.0)

    def predicted_path(self, steps: int) -> Floats:
        """Return its positions after each of the next steps, if nothing stops it.

        It is assumed to stay at its present point when it has reached it.

        Returns:
            ``(steps, 2)`` metres.
        """
        place, heading, path = self.prop.position[:2], self.heading_rad, []
        for _ in range(steps):
            if math.dist(place, self.point) >= ARRIVED_M:
                speed, turn = self.motion.towards(self.point, place, heading, self._step_s)
                ahead = np.array([math.cos(heading), math.sin(heading)])
                place, heading = place + speed * self._step_s * ahead, heading + turn * self._step_s
            path.append(place)
        return np.array(path)

    def inside(self, point: Floats) -> Floats:
        """Return the point ``(2,)`` of the room nearest to a point that the car can stand on."""
        return inside(self.room, point[:2], _ROOM_TO_TURN_M)

    def random_point(self, rng: np.random.Generator) -> Floats:
        """Draw a point of the room, ``(2,)``, on which the car can stand."""
        return self.inside(self.room.sample_floor(rng, 0.0))

    def _reachable_point(self, draw: DrawPoint, rng: np.random.Generator) -> Floats:
        """Return a drawn point with a clear way, or the last of 31 draws.

        A car that has driven between furniture may find no way that is clear by half its diagonal.
        """
        here, narrow = self.prop.position[:2], None
        clearances = Clearances(self._obstacles, _HEIGHTS_M)
        for _ in range(_DRAWS + 1):
            point = self.inside(draw(rng))
            if clearances.all_at_least(_line(here, point), _HALF_M):
                return point
            if narrow is None and self.fits_between(here, point):
                narrow = point
        return point if narrow is None else narrow

    def _vertical_mps(self) -> float:
        """Return the vertical velocity of the next step: down if it falls, up if it has sunk.

        Bullet loses contacts of things that slide far in a physics step: without this a car in the
        form of a box sank by 2 cm into the floor.
        """
        sunk_m = self._resting_m - float(self.prop.position[2])
        if sunk_m < 0.0:
            return min(float(self.prop.velocity[2]), 0.0)
        return sunk_m / self._step_s

    def _set_upright(self) -> None:
        if self.prop.rotation[2, 2] < _TIPPED:
            x, y, _ = self.prop.position
            self.prop.place((x, y, self._resting_m), self.heading_rad)


def _line(start: Floats, end: Floats) -> Floats:
    """Return points of a line without its start, at most a width of the car apart, ``(n, 2)``."""
    count = max(2, math.ceil(math.dist(start, end) / WIDTH_M))
    return start + np.linspace(1.0 / count, 1.0, count)[:, None] * (end - start)

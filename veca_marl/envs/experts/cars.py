"""Experts of DodgeCar and ChaseCar: the best of a few courses of 1.6 s."""

from __future__ import annotations

import cmath
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.tasks.cars.car_game import CarGame
from veca_marl.envs.tasks.cars.chase_car import PRESS, ChaseCar
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.envs.tasks.cars.toy_car import ARRIVED_M, SLOWEST, ToyCar
from veca_marl.envs.tasks.floors.grid_paths import CELL_M, floor_grid
from veca_marl.envs.tasks.floors.places import clearances_m, furniture_of
from veca_marl.sim.body.walker import WalkCommand, Walker, WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World

_TURNS_S = (0.25, 0.5, 0.75, 1.0, 1.5)  # durations of the first phase, in which it turns


class WalkPlans(NamedTuple):
    """Candidate courses: turn for a while, on the spot or walking, then go straight.

    Attributes:
        commands: ``(plans, steps, 2)``: (forward, turn) in [-1, 1] for each step.
        step_s: Duration of a step.
    """

    commands: Floats
    step_s: float

    def positions(self, start: Floats, yaw_rad: float, cfg: WalkerCfg) -> Floats:
        """Return the positions after each step, without obstacles.

        Args:
            start: ``(2,)`` or ``(3,)`` metres.
            yaw_rad: Heading at the start.
            cfg: The speeds of the walker.

        Returns:
            ``(plans, steps, 2)`` metres.
        """
        forward = self.commands[..., 0]
        speed = cfg.walk_speed_mps * np.where(forward < 0.0, cfg.backward_share, 1.0) * forward
        yaw = self.headings(yaw_rad, cfg)
        moves = speed[..., None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1) * self.step_s
        positions: Floats = np.asarray(start)[:2] + np.cumsum(moves, axis=1)
        return positions

    def headings(self, yaw_rad: float, cfg: WalkerCfg) -> Floats:
        """Return the headings after each step, ``(plans, steps)`` rad; arguments as above."""
        turned = np.cumsum(self.commands[..., 1], axis=1) * np.radians(cfg.turn_speed_degps)
        headings: Floats = yaw_rad + turned * self.step_s
        return headings


def walk_plans(horizon_s: float, step_s: float) -> WalkPlans:
    """Return all courses of one duration: straight ahead, straight back, stand, and with turns."""
    steps = round(horizon_s / step_s)
    plans = [_plan(steps, 0, (0.0, 0.0), forward) for forward in (1.0, -1.0, 0.0)]
    for turn_s in _TURNS_S:
        count = min(steps, round(turn_s / step_s))
        for turn in (1.0, -1.0):
            plans += [_plan(steps, count, (forward, turn), 1.0) for forward in (0.0, 1.0)]
    return WalkPlans(np.array(plans), step_s)


def _plan(steps: int, count: int, first: tuple[float, float], forward: float) -> Floats:
    """Return the commands ``(steps, 2)`` of a first phase, and of walking straight after it."""
    commands = np.zeros((steps, 2))
    commands[:count] = first
    commands[count:, 0] = forward
    return commands


_MARGIN_M = 0.02  # for distances that are interpolated between the cells of a grid
_NEARER_M = 0.001  # per step, from which a course leads towards furniture and not along it
_FAR_M = 10.0  # distance to the furniture of a room that has none


class ObstructedCourses:
    """Holds courses of a walker where they meet furniture.

    What the walker can push does not stop it. Walls are not considered.

    Args:
        walker: The walker.
        world: Its world, with all props that stop it in their places for the episode.
    """

    def __init__(self, walker: Walker, world: World) -> None:
        grid = floor_grid(world.playground)
        heavy = [prop for prop in furniture_of(world) if not walker.is_light(prop)]
        self._first_m = grid.lower_m + CELL_M / 2.0
        self._away_m = np.full(grid.shape, _FAR_M)
        for prop in heavy:
            self._away_m = np.minimum(self._away_m, clearances_m(prop, grid.centres))
        self._clear_m = walker.radius_m + _MARGIN_M

    def held(self, start: Floats, courses: Floats) -> Floats:
        """Return courses that end where furniture is touched, and then stay there.

        A course touches furniture where it is too near and comes nearer: a walker that stands
        beside a piece can walk away from it, and along it.

        Args:
            start: Where all courses start, ``(2,)`` or ``(3,)`` metres.
            courses: Places after each step without obstacles, ``(plans, steps, 2)`` metres.

        Returns:
            ``(plans, steps, 2)`` metres.
        """
        plans, steps = courses.shape[:2]
        first = np.broadcast_to(start[:2], (plans, 1, 2))
        places = np.concatenate([first, courses], axis=1)
        away_m = self._distances_m(places)
        touches = (away_m[:, 1:] < self._clear_m) & (np.diff(away_m, axis=1) < -_NEARER_M)
        free_steps = np.where(touches.any(axis=1), touches.argmax(axis=1), steps)
        shown = np.minimum(np.arange(1, steps + 1), free_steps[:, None])
        held: Floats = np.take_along_axis(places, shown[..., None], axis=1)
        return held

    def _distances_m(self, places: Floats) -> Floats:
        """Return the distances from places ``(..., 2)`` to furniture, ``(...)`` metres."""
        cells = np.moveaxis((places - self._first_m) / CELL_M, -1, 0)
        distances: Floats = map_coordinates(self._away_m, cells, order=1, mode="nearest")
        return distances


_HORIZON_S = 1.6
_WALL_M = 0.15

CarGameT = TypeVar("CarGameT", bound=CarGame)


class CarExpert(Expert[CarGameT]):
    """Predicts the path of the car and takes the best of a few courses.

    In each step it compares courses of 1.6 s and walks the first step of the best one. A course
    ends at furniture that the player cannot push.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, the room and its furniture.

    Attributes:
        plans: The courses.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self.plans = walk_plans(_HORIZON_S, self.task.world.clock.step_s)
        self._courses = ObstructedCourses(self.task.walker, self.task.world)

    def best_move(self) -> tuple[float, float]:
        """Return (forward, turn) of the first step of the course with the highest score."""
        walker, room = self.task.walker, self.task.car.room
        places = self.plans.positions(walker.position, walker.yaw_rad, walker.cfg)
        low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
        places = np.clip(places, low + _WALL_M, low + size - _WALL_M)
        places = self._courses.held(walker.position, places)
        forward, turn = self.plans.commands[int(np.argmax(self.scores(places)))][0]
        return float(forward), float(turn)

    @abstractmethod
    def scores(self, places: Floats) -> Floats:
        """Return the score of each course, ``(plans,)``.

        Args:
            places: Positions of the player on each course, ``(plans, steps, 2)`` metres.
        """


def car_paths(car: ToyCar, nexts: Floats, steps: int, step_s: float) -> Floats:
    """Return where a car will be if it drives to its point and then on to one of several others.

    It moves as by `Motion.towards`, and stays where it arrives then. Nothing stops it.

    Args:
        car: The car.
        nexts: Points that it may draw when it has reached its present one, ``(n, 2)`` metres.
        steps: Number of steps.
        step_s: Duration of a step.

    Returns:
        Positions after each step, ``(n, steps, 2)`` metres, or ``(1, steps, 2)`` if it does not
        reach its present point.
    """
    # points of the floor as complex numbers: a product with a direction is a rotation
    place, point = _complex(car.prop.position[None]), _complex(car.point[None])
    direction = np.array([cmath.exp(1j * car.heading_rad)])
    most_rad, step_m = car.motion.turn_radps * step_s, car.motion.speed_mps * step_s
    draws, path = car.needs_point, []
    for _ in range(steps):
        if len(point) == 1 and (draws or abs(point[0] - place[0]) < ARRIVED_M):
            point, draws = _complex(nexts), False
        way = point - place
        bearing = np.angle(way * direction.conj())
        moved_m = step_m * np.maximum(np.cos(bearing), SLOWEST) * (np.abs(way) >= ARRIVED_M)
        place = place + moved_m * direction
        direction = direction * np.exp(1j * np.minimum(np.maximum(bearing, -most_rad), most_rad))
        path.append(place)
    places = np.stack(np.broadcast_arrays(*path), axis=1)
    return np.stack([places.real, places.imag], axis=-1)


def room_points(car: ToyCar, along: int) -> Floats:
    """Return points spread evenly over the floor of a car's room, ``(along ** 2, 2)`` metres."""
    low, size = np.array(car.room.lower_m[:2]), np.array(car.room.size_m[:2])
    cells = np.moveaxis(np.indices((along, along)), 0, -1).reshape(-1, 2)
    points: Floats = low + size * (cells + 0.5) / along
    return points


def _complex(points: Floats) -> NDArray[np.complex128]:
    """Return points ``(n, 2)`` or ``(n, 3)`` of the floor as ``x + iy``, ``(n,)``."""
    numbers: NDArray[np.complex128] = points[:, 0] + 1j * points[:, 1]
    return numbers


# distances between the middles of car and player, which touch at about 0.3 m
_PRESS_M, _TOO_NEAR_M = 0.8, 0.55
_NEAR_WEIGHT, _FACING_WEIGHT = 4.0, 0.3


@register_expert("ChaseCar")
class ChaseCarExpert(CarExpert[ChaseCar]):
    """Predicts the path of the car to its next point, follows at a distance, and always presses.

    In each step it compares courses of 1.6 s: they should end 0.8 m from the car, facing it, and
    not come nearer than 0.55 m. A course ends at furniture that the player cannot push. A press
    out of range has no effect.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, the room and its furniture.
    """

    def act(self, observation: Mapping[str, NDArray[Any]]) -> WalkCommand:
        """Return a command for a walker with the verb `press`, see `Expert.act`."""
        forward, turn = self.best_move()
        return WalkCommand(forward, turn, verb=PRESS)

    def scores(self, places: Floats) -> Floats:
        """See `CarExpert.scores`."""
        ways = self.task.car.predicted_path(places.shape[1]) - places
        away_m = np.linalg.norm(ways, axis=-1)
        yaw = self.plans.headings(self.task.walker.yaw_rad, self.task.walker.cfg)[:, -1]
        ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        facing = (ahead * ways[:, -1]).sum(axis=-1) / np.maximum(away_m[:, -1], 1e-6)
        too_near_m = np.maximum(_TOO_NEAR_M - away_m.min(axis=1), 0.0)
        off_m = np.abs(away_m[:, -1] - _PRESS_M)
        scores: Floats = _FACING_WEIGHT * facing - off_m - _NEAR_WEIGHT * too_near_m
        return scores


# distances between the middles of car and player, which touch at about 0.3 m
_SAFE_M, _FAR_CAR_M = 0.6, 2.5
_POINTS_ALONG = 4  # of the points that the car may draw, in each direction of the room
_FAR_WEIGHT, _MIDDLE_WEIGHT, _SIDE_WEIGHT = 0.1, 0.1, 0.2


@register_expert("DodgeCar")
class DodgeCarExpert(CarExpert[DodgeCar]):
    """Predicts the paths that the car may take and walks where it does not pass.

    In each step it compares courses of 1.6 s: by the least distance to the car, if that is below
    0.6 m, then by the distance at the end, by the distance from the middle of the room, where it
    can walk to either side, and by how far it then faces across the line to the car, from where a
    single step forward avoids the car. Where the car will draw another point within that time, the
    mean over 16 points of the room counts. A course ends at furniture that the player cannot push.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, the room and its furniture.
    """

    def reset(self) -> None:
        """See `Expert.reset`."""
        super().reset()
        self._next_points = room_points(self.task.car, _POINTS_ALONG)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> tuple[float, float]:
        """Return (forward, turn), see `Expert.act`."""
        return self.best_move()

    def scores(self, places: Floats) -> Floats:
        """See `CarExpert.scores`."""
        steps, step_s = places.shape[1], self.plans.step_s
        cars = car_paths(self.task.car, self._next_points, steps, step_s)
        ways = cars - places[:, None]
        away_m = np.hypot(ways[..., 0], ways[..., 1])
        yaw = self.plans.headings(self.task.walker.yaw_rad, self.task.walker.cfg)[:, -1, None]
        x, y = np.moveaxis(ways[..., -1, :], -1, 0)
        across = np.abs(np.cos(yaw) * y - np.sin(yaw) * x) / np.maximum(away_m[..., -1], 1e-6)
        middle = self.task.car.room.middle_m[:2]
        from_middle_m = np.linalg.norm(places[:, -1] - middle, axis=-1)
        least = np.minimum(away_m.min(axis=-1), _SAFE_M).mean(axis=-1)
        far = np.minimum(away_m[..., -1], _FAR_CAR_M)
        later = (_FAR_WEIGHT * far + _SIDE_WEIGHT * across).mean(axis=-1)
        scores: Floats = least + later - _MIDDLE_WEIGHT * from_middle_m
        return scores

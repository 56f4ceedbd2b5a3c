"""Experts of DodgeCar and ChaseCar: the best of a few courses against the car's predicted path."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.walk_plans import walk_plans
from veca_marl.envs.tasks.cars.car_game import CarGame
from veca_marl.envs.tasks.cars.chase_car import PRESS, ChaseCar
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.sim.body.walker import WalkCommand
from veca_marl.sim.geometry import Floats

_HORIZON_S = 1.6
_WALL_M = 0.15
# distances between the middles of car and player, who touch at about 0.3 m
_SAFE_M, _FAR_M = 0.6, 2.5
_FAR_WEIGHT, _MIDDLE_WEIGHT = 0.15, 0.05
_PRESS_M, _TOO_NEAR_M = 0.8, 0.55
_NEAR_WEIGHT, _FACING_WEIGHT = 4.0, 0.3

CarGameT = TypeVar("CarGameT", bound=CarGame)


class CarExpert(Expert[CarGameT]):
    """Predicts the path of the car to its next point and takes the best of a few courses.

    In each step it compares courses of 1.6 s and walks the first step of the best one. Furniture is
    not considered.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, and the room.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._plans = walk_plans(_HORIZON_S, self.task.world.clock.step_s)

    def _best_move(self) -> tuple[float, float]:
        """Return (forward, turn) of the first step of the course with the highest score."""
        walker, room = self.task.walker, self.task.car.room
        places = self._plans.positions(walker.position, walker.yaw_rad, walker.cfg)
        low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
        places = np.clip(places, low + _WALL_M, low + size - _WALL_M)
        car = self.task.car.predicted_path(places.shape[1])
        forward, turn = self._plans.commands[int(np.argmax(self._scores(places, car)))][0]
        return float(forward), float(turn)

    @abstractmethod
    def _scores(self, places: Floats, car: Floats) -> Floats:
        """Return the score of each course, ``(plans,)``.

        Args:
            places: Positions of the player on each course, ``(plans, steps, 2)`` metres.
            car: Predicted positions of the car, ``(steps, 2)`` metres.
        """


@register_expert("DodgeCar")
class DodgeCarExpert(CarExpert[DodgeCar]):
    """Predicts the path of the car to its next point and walks where it does not pass.

    In each step it compares courses of 1.6 s: by the least distance to the car, if that is below
    0.6 m, then by the distance at the end, and by the distance from the middle of the room.
    Furniture is not considered.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, and the room.
    """

    def act(self, observation: Mapping[str, NDArray[Any]]) -> tuple[float, float]:
        """Return (forward, turn), see `Expert.act`."""
        return self._best_move()

    def _scores(self, places: Floats, car: Floats) -> Floats:
        away_m = np.linalg.norm(places - car, axis=-1)
        middle = self.task.car.room.middle_m[:2]
        from_middle_m = np.linalg.norm(places[:, -1] - middle, axis=-1)
        least = np.minimum(away_m.min(axis=1), _SAFE_M)
        far = np.minimum(away_m[:, -1], _FAR_M)
        scores: Floats = least + _FAR_WEIGHT * far - _MIDDLE_WEIGHT * from_middle_m
        return scores


@register_expert("ChaseCar")
class ChaseCarExpert(CarExpert[ChaseCar]):
    """Predicts the path of the car to its next point, follows at a distance, and always presses.

    In each step it compares courses of 1.6 s: they should end 0.8 m from the car, facing it, and
    not come nearer than 0.55 m. A press out of range has no effect. Furniture is not considered.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, and the room.
    """

    def act(self, observation: Mapping[str, NDArray[Any]]) -> WalkCommand:
        """Return a command for a walker with the verb `press`, see `Expert.act`."""
        forward, turn = self._best_move()
        return WalkCommand(forward, turn, verb=PRESS)

    def _scores(self, places: Floats, car: Floats) -> Floats:
        ways = car - places
        away_m = np.linalg.norm(ways, axis=-1)
        yaw = self._plans.headings(self.task.walker.yaw_rad, self.task.walker.cfg)[:, -1]
        ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        facing = (ahead * ways[:, -1]).sum(axis=-1) / np.maximum(away_m[:, -1], 1e-6)
        too_near_m = np.maximum(_TOO_NEAR_M - away_m.min(axis=1), 0.0)
        off_m = np.abs(away_m[:, -1] - _PRESS_M)
        scores: Floats = _FACING_WEIGHT * facing - off_m - _NEAR_WEIGHT * too_near_m
        return scores

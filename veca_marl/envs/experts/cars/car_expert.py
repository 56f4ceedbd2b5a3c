"""Base of the experts of DodgeCar and ChaseCar: the best of a few courses of 1.6 s."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

import numpy as np

from veca_marl.envs.core.expert import Expert
from veca_marl.envs.experts.control.paths.obstructed_courses import ObstructedCourses
from veca_marl.envs.experts.control.paths.walk_plans import walk_plans
from veca_marl.envs.tasks.cars.car_game import CarGame
from veca_marl.sim.geometry import Floats

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

"""Expert of DodgeCar: the course that stays farthest from the predicted path of the car."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.walk_plans import walk_plans
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.sim.geometry import Floats

_HORIZON_S = 1.6
_SAFE_M = 0.6  # between the middles of car and player, who touch at about 0.3 m
_FAR_M = 2.5
_WALL_M = 0.15
_FAR_WEIGHT, _MIDDLE_WEIGHT = 0.15, 0.05


@register_expert("DodgeCar")
class DodgeCarExpert(Expert[DodgeCar]):
    """Predicts the path of the car to its next point and walks where it does not pass.

    In each step it compares courses of 1.6 s: by the least distance to the car, if that is below
    0.6 m, then by the distance at the end, and by the distance from the middle of the room.
    Furniture is not considered.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, and the room.
    """

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._plans = walk_plans(_HORIZON_S, self.task.world.clock.step_s)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> tuple[float, float]:
        """Return (forward, turn), see `Expert.act`."""
        task = self.task
        places = self._plans.positions(task.walker.position, task.walker.yaw_rad, task.walker.cfg)
        low, size = np.array(task.car.room.lower_m[:2]), np.array(task.car.room.size_m[:2])
        places = np.clip(places, low + _WALL_M, low + size - _WALL_M)
        car = task.car.predicted_path(places.shape[1])
        forward, turn = self._plans.commands[int(np.argmax(self._scores(places, car)))][0]
        return float(forward), float(turn)

    def _scores(self, places: Floats, car: Floats) -> Floats:
        """Return the score of each course ``(plans,)``."""
        away_m = np.linalg.norm(places - car, axis=-1)
        middle = self.task.car.room.middle_m[:2]
        from_middle_m = np.linalg.norm(places[:, -1] - middle, axis=-1)
        least = np.minimum(away_m.min(axis=1), _SAFE_M)
        far = np.minimum(away_m[:, -1], _FAR_M)
        scores: Floats = least + _FAR_WEIGHT * far - _MIDDLE_WEIGHT * from_middle_m
        return scores

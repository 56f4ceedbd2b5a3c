"""Expert of DodgeCar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.experts.cars.car_expert import CarExpert
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.sim.geometry import Floats

# distances between the middles of car and player, which touch at about 0.3 m
_SAFE_M, _FAR_M = 0.6, 2.5
_FAR_WEIGHT, _MIDDLE_WEIGHT, _SIDE_WEIGHT = 0.1, 0.1, 0.2


@register_expert("DodgeCar")
class DodgeCarExpert(CarExpert[DodgeCar]):
    """Predicts the path of the car to its next point and walks where it does not pass.

    In each step it compares courses of 1.6 s: by the least distance to the car, if that is below
    0.6 m, then by the distance at the end, by the distance from the middle of the room, where it
    can walk to either side, and by how far it then faces across the line to the car, from where a
    single step forward avoids the car. Furniture is not considered.

    Reads privileged state: position and heading of car and player, the point that the car drives
    to, and the room.
    """

    def act(self, observation: Mapping[str, NDArray[Any]]) -> tuple[float, float]:
        """Return (forward, turn), see `Expert.act`."""
        return self.best_move()

    def scores(self, places: Floats, car: Floats) -> Floats:
        """See `CarExpert.scores`."""
        ways = car - places
        away_m = np.linalg.norm(ways, axis=-1)
        yaw = self.plans.headings(self.task.walker.yaw_rad, self.task.walker.cfg)[:, -1]
        x, y = ways[:, -1].T
        across = np.abs(np.cos(yaw) * y - np.sin(yaw) * x) / np.maximum(away_m[:, -1], 1e-6)
        middle = self.task.car.room.middle_m[:2]
        from_middle_m = np.linalg.norm(places[:, -1] - middle, axis=-1)
        least = np.minimum(away_m.min(axis=1), _SAFE_M)
        far = np.minimum(away_m[:, -1], _FAR_M)
        later = _FAR_WEIGHT * far - _MIDDLE_WEIGHT * from_middle_m + _SIDE_WEIGHT * across
        scores: Floats = least + later
        return scores

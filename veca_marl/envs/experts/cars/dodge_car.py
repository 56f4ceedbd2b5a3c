"""Expert of DodgeCar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.experts.cars.car_expert import CarExpert
from veca_marl.envs.experts.cars.car_paths import car_paths, room_points
from veca_marl.envs.tasks.cars.dodge_car import DodgeCar
from veca_marl.sim.geometry import Floats

# distances between the middles of car and player, which touch at about 0.3 m
_SAFE_M, _FAR_M = 0.6, 2.5
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
        far = np.minimum(away_m[..., -1], _FAR_M)
        later = (_FAR_WEIGHT * far + _SIDE_WEIGHT * across).mean(axis=-1)
        scores: Floats = least + later - _MIDDLE_WEIGHT * from_middle_m
        return scores

"""Expert of ChaseCar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.experts.cars.car_expert import CarExpert
from veca_marl.envs.tasks.cars.chase_car import PRESS, ChaseCar
from veca_marl.sim.body.walker import WalkCommand
from veca_marl.sim.geometry import Floats

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

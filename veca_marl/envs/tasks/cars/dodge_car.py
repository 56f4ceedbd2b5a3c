"""DodgeCar: keep out of the way of a fast toy car."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register, terms
from veca_marl.envs.tasks.cars.car_game import CarGame, CarGameCfg
from veca_marl.sim.geometry import Floats, horizontal_distance


@dataclass
class DodgeCarCfg(CarGameCfg):
    """Parameters of DodgeCar. None of them is in the paper.

    Attributes:
        aim: Probability with which the car drives to where the player is at that moment, instead of
            to a random point of the room, in [0, 1].
        aim_from_m: Least distance of car and player for that: from nearer by, the player could not
            get out of the way.
    """

    max_seconds: float = 30.0
    aim: float = 0.6
    aim_from_m: float = 1.2
    weights: dict[str, float] = terms(hit=-1.0, survived=0.05)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("aim_from_m")
        if not 0.0 <= self.aim <= 1.0:
            raise ValueError(f"task.aim={self.aim} must be in [0, 1]")


@register
class DodgeCar(CarGame):
    """A fast toy car drives round the room; the player has to dodge it.

    The car drives in straight lines from point to point. With the probability `aim` the next point
    is where the player stands when it is drawn, if the car is far enough away, so that no place of
    the room is safe for long. A contact of car and player terminates the episode. The task is
    solved (`solved`) as long as they have not touched.

    The paper states senses, actions and "the toy car moves around in the room fast. The agent must
    dodge the car" (table of tasks in the appendix). The motion of the car, the rewards and the end
    of an episode are ours.

    Terms:
        hit: 1 on the step in which car and player touch, else 0.
        survived: Duration of the step, s, if they do not touch, else 0; 30 s give 1.5 with
            the default weight.
    """

    senses = ("vision",)
    cfg: DodgeCarCfg

    def next_point(self, rng: np.random.Generator) -> Floats:
        here = self.walker.position[:2]
        is_far = horizontal_distance(here, self.car.prop.position) >= self.cfg.aim_from_m
        if is_far and rng.random() < self.cfg.aim:
            return here
        return self.car.random_point(rng)

    def reward(self, player: Player) -> dict[str, float]:
        survived_s = 0.0 if self.touched else self.world.clock.step_s
        return {"hit": float(self.touched), "survived": survived_s}

    def solved(self, player: Player) -> bool:
        """Return whether car and player have not touched."""
        return not self.touched

"""What the tasks with a toy car share: numbers, placement, and the collision of car and player."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from veca_marl.envs.core.task import Task, TaskCfg, require_walker
from veca_marl.envs.tasks.cars.toy_car import Motion, ToyCar, check_speed
from veca_marl.envs.tasks.floors.places import (
    Spacing,
    furniture_of,
    planned_furniture,
    scattered_places,
)
from veca_marl.envs.tasks.floors.playability import check_placement
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg
from veca_marl.sim.sound import SoundCfg, SoundKind

_CLEAR_M = 0.35  # of starting places, from walls and furniture
_MOTOR_HZ = 110.0  # below the ball of KickTheBall, 150, so that the two can be told apart


@dataclass
class CarGameCfg(TaskCfg):
    """Parameters of tasks with a toy car. None of them is in the paper.

    Attributes:
        speed_mps: Speed of the car on a straight line; see `check_speed` for its limit.
        turn_degps: Greatest turning speed of the car.
        apart_m: Least distance between the middles of car and player at the start.
        loudness: Level of the motor's sound, see `SoundCfg`. Players of these tasks do not hear; a
            task that is derived from them and has ``audio`` among its senses observes it.
    """

    speed_mps: float = 1.5
    turn_degps: float = 240.0
    apart_m: float = 1.5
    loudness: float = 0.03

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("speed_mps", "turn_degps", "apart_m")
        self.check_not_negative("loudness")

    def sound(self) -> SoundCfg:
        """Return the sound of the car's motor."""
        return SoundCfg(SoundKind.buzz, frequency_hz=_MOTOR_HZ, level=self.loudness)


class CarGame(Task):
    """A walker and a toy car in one room.

    Attributes:
        walker: The body of the player.
        car: The car.
        touched: Whether car and player have touched each other in the last step.
        interactions: Names of the verbs that can be applied to the car.
    """

    interactions: ClassVar[tuple[str, ...]] = ()
    body_cfg = WalkerCfg
    cfg: CarGameCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        if len(playground.rooms) > 1:
            raise ValueError(
                f"{cls.__name__}: playground {playground.name!r} has {len(playground.rooms)} "
                "rooms; the car drives in one, so that another is a hiding place: choose "
                "playground=simple or single_room"
            )
        furniture, spacing = planned_furniture(playground), _spacing(cfg)
        check_placement(
            lambda rng: scattered_places(playground, furniture, 2, spacing, rng),
            f"{cls.__name__} with task.apart_m={cfg.apart_m:g}",
            "a smaller one, or a larger room, such as playground=simple",
        )

    @classmethod
    def check_clock(cls, cfg: Any, clock: ClockCfg) -> None:
        check_speed(cfg.speed_mps, clock)

    def build(self) -> None:
        self.walker = require_walker(self.players[0])
        self._furniture = furniture_of(self.world)
        motion = Motion(self.cfg.speed_mps, math.radians(self.cfg.turn_degps))
        self.car = ToyCar(self.world, motion, self.cfg.sound(), self.interactions)
        self.touched = False
        self.world.after_substep.append(self._notice_contact)

    def reset(self, rng: np.random.Generator) -> None:
        spacing = _spacing(self.cfg)
        start, place = scattered_places(self.world.playground, self._furniture, 2, spacing, rng)
        self.walker.place(start, rng.uniform(-math.pi, math.pi))
        self.car.reset(place, rng)
        self.touched = False

    def before_step(self, rng: np.random.Generator) -> None:
        self.touched = False
        self.car.drive(self.next_point, rng)

    @abstractmethod
    def next_point(self, rng: np.random.Generator) -> Floats:
        """Draw a point of the floor for the car to drive to, ``(2,)`` metres."""

    def state(self) -> dict[str, float]:
        return {
            "heads_for_x_m": float(self.car.point[0]),
            "heads_for_y_m": float(self.car.point[1]),
        }

    def terminated(self) -> bool:
        return self.touched

    def _notice_contact(self) -> None:
        """Store a contact of any physics step: a car that bounces off is gone after the last."""
        self.touched = self.touched or self.walker.touches(self.car.prop)


def _spacing(cfg: CarGameCfg) -> Spacing:
    return Spacing(_CLEAR_M, cfg.apart_m, 0.0)

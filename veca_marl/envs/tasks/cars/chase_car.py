"""ChaseCar: follow a fast toy car and press it without touching it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from veca_marl.envs.core.task import Player, register_task, terms
from veca_marl.envs.tasks.cars.car_game import CarGame, CarGameCfg
from veca_marl.sim.geometry import Floats, horizontal_distance

PRESS = "press"
_MOST_CHOICES = 1000


@dataclass
class ChaseCarCfg(CarGameCfg):
    """Parameters of ChaseCar. None of them is in the paper.

    Attributes:
        presses: How often the car has to be pressed.
        rest_s: Time after a press in which another one does not count.
        choices: The car drives to the one of so many random points that is farthest from the
            player, at most 1000; with 1 it takes no notice of the player.
    """

    max_seconds: float = 40.0
    speed_mps: float = 1.2
    presses: int = 3
    rest_s: float = 2.0
    choices: int = 3
    weights: dict[str, float] = terms(pressed=1.0, hit=-1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("rest_s")
        for name in ("presses", "choices"):
            if getattr(self, name) < 1:
                raise ValueError(f"task.{name}={getattr(self, name)} must be at least 1")
        if self.choices > _MOST_CHOICES:
            raise ValueError(f"task.choices={self.choices} must be at most {_MOST_CHOICES}")


@register_task
class ChaseCar(CarGame):
    """A toy car drives away from the player. The player has to come near and press it.

    The player presses the car by the choice `press` of the action part `verb`, while the car is
    interactable: visible and within `body.interaction_range_m`, 1 m with the default body. A press
    counts if the last one was at least `rest_s` ago. The episode terminates after `presses`
    presses; then the task is solved (`solved`). A contact of car and player terminates it unsolved.

    The paper states senses, the two action parts and "the toy car moves around in the room fast.
    The agent must chase and interact with the car, but must not collide with the car" (table of
    tasks in the appendix). The verb, the motion of the car, the rewards and the end of an episode
    are ours. Several presses are required, because a player that stands and presses all the time is
    sometimes passed by the car.

    Terms:
        pressed: 1 on the step of a press that counts, else 0.
        hit: 1 on the step in which car and player touch, else 0.
    """

    senses = ("vision", "touch", "proprioception")
    interactions: ClassVar[tuple[str, ...]] = (PRESS,)
    verbs = (PRESS,)
    cfg: ChaseCarCfg

    def build(self) -> None:
        super().build()
        self._presses = 0
        self._rest_steps = 0
        self._pressed_now = False

    def reset(self, rng: np.random.Generator) -> None:
        super().reset(rng)
        self._presses, self._rest_steps, self._pressed_now = 0, 0, False

    def next_point(self, rng: np.random.Generator) -> Floats:
        points = [self.car.random_point(rng) for _ in range(self.cfg.choices)]
        here = self.walker.position
        return max(points, key=lambda point: horizontal_distance(point, here))

    def after_step(self, rng: np.random.Generator) -> None:
        applied = self.walker.applied_verb
        pressed = applied is not None and (applied.verb, applied.prop) == (PRESS, self.car.prop)
        self._rest_steps -= 1
        self._pressed_now = pressed and self._rest_steps <= 0 and not self.touched
        if self._pressed_now:
            self._presses += 1
            self._rest_steps = round(self.cfg.rest_s / self.world.clock.step_s)

    def reward(self, player: Player) -> dict[str, float]:
        return {"pressed": float(self._pressed_now), "hit": float(self.touched)}

    def state(self) -> dict[str, float]:
        rest_s = max(self._rest_steps, 0) * self.world.clock.step_s
        return {**super().state(), "presses": float(self._presses), "rest_s": rest_s}

    def terminated(self) -> bool:
        return self.touched or self.solved(self.players[0])

    def solved(self, player: Player) -> bool:
        """Return whether the car has been pressed often enough."""
        return self._presses >= self.cfg.presses

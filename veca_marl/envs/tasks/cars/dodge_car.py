"""DodgeCar: keep out of the way of a fast toy car."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register_task, terms
from veca_marl.envs.tasks.cars.car_game import CarGame, CarGameCfg
from veca_marl.envs.tasks.cars.toy_car import inside
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics.rooms import RoomCfg

_WINDOW_S = 0.4  # over which motion is averaged: single actions of a random policy say little


class Forecast:
    """Positions and headings of the last 0.4 s, and the course that continues them.

    Args:
        walker: The walker.
        room: The room that it does not leave.
        step_s: Duration of an agent step.
    """

    def __init__(self, walker: Walker, room: RoomCfg, step_s: float) -> None:
        self._walker, self._room, self._step_s = walker, room, step_s
        length = max(2, round(_WINDOW_S / step_s) + 1)
        self._seen: deque[tuple[Floats, float]] = deque(maxlen=length)

    def reset(self) -> None:
        """Forget the motion before."""
        self._seen.clear()

    def observe(self) -> None:
        """Store where the walker is. Called once per step."""
        self._seen.append((self._walker.position[:2].copy(), self._walker.yaw_rad))

    def meeting_place(self, start: Floats, speed_mps: float, longest_s: float) -> Floats:
        """Return the place at which something that starts now meets the walker.

        Args:
            start: Where it starts, ``(2,)`` or ``(3,)`` metres.
            speed_mps: Its speed, on a straight line.
            longest_s: The walker is taken to stand still after so much time.

        Returns:
            ``(2,)`` metres, within the room.
        """
        course = self._course(round(longest_s / self._step_s))
        place: Floats
        for step, place in enumerate(course):
            if horizontal_distance(start, place) <= step * self._step_s * speed_mps:
                break
        return place

    def _course(self, steps: int) -> Floats:
        """Return the present place, and those after each of the next steps, ``(1 + steps, 2)``."""
        here = self._walker.position[:2]
        before, yaw_before = self._seen[0] if self._seen else (here, self._walker.yaw_rad)
        past_s = max(1, len(self._seen) - 1) * self._step_s
        velocity = (here - before) / past_s
        turn_radps = (self._walker.yaw_rad - yaw_before) / past_s
        # the mean velocity is that of the middle of the past
        times = past_s / 2.0 + (np.arange(steps) + 0.5) * self._step_s
        cos, sin = np.cos(turn_radps * times), np.sin(turn_radps * times)
        x, y = velocity
        moves = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1) * self._step_s
        course = here + np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])
        return inside(self._room, course, self._walker.radius_m)


_CORRECTION_S = 0.2  # between two corrections of the point where car and player will meet
_DRAWS = 10  # of points from which the line to the player may be clear


@dataclass
class DodgeCarCfg(CarGameCfg):
    """Parameters of DodgeCar. None of them is in the paper.

    Attributes:
        aim: Probability with which the car drives at the player, instead of to a random point of
            the room, in [0, 1].
        aim_from_m: Least distance of car and player for that. From nearer by it drives straight on:
            the player could not get out of the way of a car that still turns.
        lead_s: Greatest time for which it takes the player to go on walking and turning as in the
            last 0.4 s; with 0 it drives at where the player is.
    """

    max_seconds: float = 30.0
    aim: float = 0.6
    aim_from_m: float = 1.5
    lead_s: float = 2.0
    weights: dict[str, float] = terms(hit=-1.0, survived=0.05)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("aim_from_m")
        if not 0.0 <= self.aim <= 1.0:
            raise ValueError(f"task.aim={self.aim} must be in [0, 1]")
        if not 0.0 <= self.lead_s < math.inf:
            raise ValueError(f"task.lead_s={self.lead_s} must be 0 or a positive number")


@register_task
class DodgeCar(CarGame):
    """A fast toy car drives round the room; the player has to dodge it.

    The car drives from point to point. With the probability `aim`, if it is far enough away, it
    drives at the player: to where they will meet if the player goes on walking and turning as in
    the last 0.4 s. It corrects that point every 0.2 s until it is `aim_from_m` away, and then
    drives straight on. So a player is hit that stands still or repeats one motion, and one is
    missed that changes its motion when the car is near. If furniture obstructs the straight line to
    the player, the car first drives to a point from which the line is clear. It is narrower than
    the player and lower than a table, so that no position in the room is safe for long. A contact
    of car and player terminates the episode. The task is solved (`solved`) as long as they have not
    touched.

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

    def build(self) -> None:
        super().build()
        step_s = self.world.clock.step_s
        self._forecast = Forecast(self.walker, self.car.room, step_s)
        self._correction_steps = max(1, round(_CORRECTION_S / step_s))
        self._aims, self._age_steps = False, 0

    def reset(self, rng: np.random.Generator) -> None:
        super().reset(rng)
        self._forecast.reset()
        self._aims, self._age_steps = False, 0

    def before_step(self, rng: np.random.Generator) -> None:
        self._forecast.observe()
        if self.car.needs_point:
            self._aims, self._age_steps = rng.random() < self.cfg.aim, 0
        away_m = horizontal_distance(self.walker.position, self.car.prop.position)
        self._aims = self._aims and away_m >= self.cfg.aim_from_m
        if self._aims and self._age_steps % self._correction_steps == 0:
            self._drive_at_player()
        self._age_steps += 1
        super().before_step(rng)

    def next_point(self, rng: np.random.Generator) -> Floats:
        """Draw a point; if the car aims at the player, one with a clear line to the player."""
        point = self.car.random_point(rng)
        if not self._aims:
            return point
        here = self.walker.position[:2]
        for _ in range(_DRAWS):
            if self.car.fits_between(point, here):
                break
            point = self.car.random_point(rng)
        return point

    def _drive_at_player(self) -> None:
        """Drive to where car and player will meet, or to the player, unless both are obstructed."""
        start, here = self.car.prop.position[:2], self.walker.position[:2]
        ahead = self._forecast.meeting_place(start, self.cfg.speed_mps, self.cfg.lead_s)
        for point in (ahead, here):
            if self.car.fits_between(start, point):
                self.car.drive_to(point)
                break

    def reward(self, player: Player) -> dict[str, float]:
        survived_s = 0.0 if self.touched else self.world.clock.step_s
        return {"hit": float(self.touched), "survived": survived_s}

    def solved(self, player: Player) -> bool:
        """Return whether car and player have not touched."""
        return not self.touched

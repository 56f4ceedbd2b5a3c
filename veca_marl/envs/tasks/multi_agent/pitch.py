"""The soccer pitch: a ball, a goal between boards, corners that give the ball back."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import Prop, PropCfg, PropShape
from veca_marl.sim.physics.world import World

POST_M = 0.04
_BOARD_M = (0.06, 0.3)  # thickness and height
_CORNER_M = 0.5  # of the floor, along both walls, behind a board across each corner
_WHITE, _YELLOW, _ORANGE = (0.95, 0.95, 0.95), (0.95, 0.75, 0.1), (1.0, 0.4, 0.05)


class PitchCfg(Protocol):
    """What a pitch is told, see `SoccerCfg`."""

    radius_m: float
    mass_kg: float
    goal_width_m: float
    goal_height_m: float
    goal_from_wall_m: float


class Pitch:
    """A pitch in the first room of a world; it lies along x, the goal is at the greater end.

    Attributes:
        goal: ``(3,)`` metres, the middle of the goal line on the floor.
        goal_width_m: Between the axes of the posts.
        ball: The ball.
        low: ``(2,)`` metres, a corner of the floor before the goal line.
        high: ``(2,)`` metres, the corner across.
    """

    def __init__(self, world: World, cfg: PitchCfg) -> None:
        room = world.playground.rooms[0]
        low, size = np.array(room.lower_m), np.array(room.size_m)
        self._cfg, self.goal_width_m = cfg, cfg.goal_width_m
        self.goal: Floats = low + np.array([size[0] - cfg.goal_from_wall_m, size[1] / 2.0, 0.0])
        self.low: Floats = low[:2]
        self.high: Floats = np.array([self.goal[0], low[1] + size[1]])
        self.ball = self._lay_ball(world)
        self._set_goal(world)
        self._set_boards(world)

    def holds(self, length_m: float, width_m: float) -> bool:
        """Say whether a part of the floor before the goal's middle is clear of the boards."""
        size = self.high - self.low
        return bool(length_m <= size[0] - 0.3 and width_m <= size[1] - 0.6)

    def scores(self, before: Floats, after: Floats) -> bool:
        """Say whether the ball's centre came through the goal's mouth, from the front.

        Args:
            before: ``(3,)`` metres: where it was.
            after: ``(3,)`` metres: where it is, one step later; its way is taken as straight.
        """
        if not before[0] < self.goal[0] <= after[0]:
            return False
        share = (self.goal[0] - before[0]) / (after[0] - before[0])
        _, aside, height = before + share * (after - before) - self.goal
        return bool(abs(aside) < self._cfg.goal_width_m / 2.0 and height < self._cfg.goal_height_m)

    def _lay_ball(self, world: World) -> Prop:
        middle = (self.low + self.high) / 2.0
        return world.add_prop(
            PropCfg(
                name="ball",
                shape=PropShape.sphere,
                size_m=[self._cfg.radius_m],
                position_m=(float(middle[0]), float(middle[1]), self._cfg.radius_m),
                mass_kg=self._cfg.mass_kg,
                restitution=0.7,
                rolling_friction=0.004,
                colour=_ORANGE,
                checker_m=self._cfg.radius_m,
            )
        )

    def _set_goal(self, world: World) -> None:
        x, y, z = self.goal.tolist()
        world.add_prop(
            PropCfg(
                name="goal",
                shape=PropShape.goal,
                size_m=[self._cfg.goal_width_m, self._cfg.goal_height_m, POST_M],
                position_m=(x, y, z),
                colour=_YELLOW,
            )
        )

    def _set_boards(self, world: World) -> None:
        """Close the goal line beside the posts, and cut the corners: no ball is lost in them."""
        half_m = self._cfg.goal_width_m / 2.0
        centre = float(self.goal[1])
        for side, edge in (("right", self.low[1]), ("left", self.high[1])):
            inwards = math.copysign(1.0, centre - edge)
            post = np.array([self.goal[0], centre - inwards * half_m])
            corner = np.array([self.goal[0], edge])
            back = np.array([self.low[0], edge])
            along, across = np.array([_CORNER_M, 0.0]), np.array([0.0, _CORNER_M * inwards])
            _board(world, f"end_{side}", post, corner)
            _board(world, f"corner_{side}", corner - along, corner + across)
            _board(world, f"back_{side}", back + along, back + across)


def _board(world: World, name: str, start: Floats, end: Floats) -> None:
    """Put a low board between two points ``(2,)`` of the floor; a ball comes back from it."""
    way, middle = end - start, (start + end) / 2.0
    thickness, height = _BOARD_M
    world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.box,
            size_m=[float(np.hypot(*way)), thickness, height],
            position_m=(float(middle[0]), float(middle[1]), height / 2.0),
            yaw_deg=math.degrees(math.atan2(way[1], way[0])),
            restitution=1.0,
            colour=_WHITE,
        )
    )

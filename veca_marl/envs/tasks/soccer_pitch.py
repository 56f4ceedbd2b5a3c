"""The pitch of the soccer tasks: its parameters, and ball, goal and boards."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import TaskCfg, terms
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World

POST_M = 0.04  # radius of posts and bar
CHILD_M = 0.45  # from the pelvis of a body on hands and knees to the front of its head, at most


@dataclass
class SoccerCfg(TaskCfg):
    """Parameters of SoccerOnePlayer. The pitch lies along x; the attacker shoots towards +x.

    Attributes:
        radius_m: Radius of the ball.
        mass_kg: Mass of the ball, at most `WalkerCfg.push_limit_kg` of players that walk.
        goal_width_m: Distance between the axes of the posts.
        goal_height_m: Height of the bar.
        goal_from_wall_m: Distance of the goal line from the end of the room, above `radius_m`.
        ball_from_goal_m: Least and greatest distance of the ball from the goal line at the start.
        aside_m: Largest lateral distance of ball and players from the middle line at the start.
        attacker_from_ball_m: Least and greatest distance of the attacker behind the ball at the
            start; at least 0.45 m from its surface.
        spread_deg: Largest angle at the start between the heading of a player and the direction
            of the ball, in [0, 180].
        kick_rest_s: Least time between two kicks of a player.
    """

    radius_m: float = 0.12
    mass_kg: float = 0.3
    goal_width_m: float = 1.4
    goal_height_m: float = 0.8
    goal_from_wall_m: float = 0.5
    ball_from_goal_m: tuple[float, float] = (2.0, 2.8)
    aside_m: float = 0.8
    attacker_from_ball_m: tuple[float, float] = (0.8, 1.6)
    spread_deg: float = 30.0
    kick_rest_s: float = 0.5
    weights: dict[str, float] = terms(goal=5.0, progress=0.5, approach=0.1, facing=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("radius_m", "mass_kg", "goal_from_wall_m", "kick_rest_s")
        for name in ("goal_width_m", "goal_height_m"):
            if not 2.0 * (self.radius_m + POST_M) < getattr(self, name) < math.inf:
                raise ValueError(
                    f"task.{name}={getattr(self, name)}: a ball of task.radius_m={self.radius_m} "
                    "does not fit through"
                )
        self._check_span("ball_from_goal_m", 0.3, "0.3 m or more")
        apart_m = self.radius_m + CHILD_M
        self._check_span(
            "attacker_from_ball_m",
            apart_m,
            f"at least {apart_m:g}: task.radius_m={self.radius_m:g} and {CHILD_M} m from pelvis to "
            "head",
        )
        if self.goal_from_wall_m <= self.radius_m:
            raise ValueError(
                f"task.goal_from_wall_m={self.goal_from_wall_m} must be larger than task.radius_m="
                f"{self.radius_m}: else the wall stops the ball before its centre passes the line"
            )
        if not 0.0 <= self.aside_m < math.inf:
            raise ValueError(f"task.aside_m={self.aside_m} must be 0 or more")
        if not 0.0 <= self.spread_deg <= 180.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 180]")


_BOARD_M = (0.06, 0.3)  # thickness and height
_CLEAR_AT_THE_END_M, _CLEAR_AT_THE_SIDES_M = 0.3, 0.6
_CORNER_M = 0.5  # length along both walls that the board across a corner cuts off
_WHITE, _YELLOW, _ORANGE = (0.95, 0.95, 0.95), (0.95, 0.75, 0.1), (1.0, 0.4, 0.05)


def check_start_area(cfg: SoccerCfg, playground: PlaygroundCfg) -> None:
    """Check that the start is clear of the boards, and that nothing is in front of the goal.

    Raises:
        ValueError: If it does not fit into the first room, or a prop has its middle there.
    """
    room = playground.rooms[0]
    length_m = cfg.ball_from_goal_m[1] + cfg.attacker_from_ball_m[1]
    width_m = 2.0 * cfg.aside_m
    free_m = room.size_m[0] - cfg.goal_from_wall_m - _CLEAR_AT_THE_END_M
    if length_m > free_m or width_m > room.size_m[1] - _CLEAR_AT_THE_SIDES_M:
        raise ValueError(
            f"playground {playground.name!r}: {length_m:g} m of task.ball_from_goal_m and "
            f"task.attacker_from_ball_m, {width_m:g} m of task.aside_m do not fit into room "
            f"{room.name!r} of {room.size_m[0]:g} x {room.size_m[1]:g} m; choose smaller ones, or "
            "playground=simple"
        )
    x, y, _ = room.middle_m
    goal_x = x + room.size_m[0] / 2.0 - cfg.goal_from_wall_m
    for prop in playground.built_props():
        along_m, aside_m = goal_x - prop.position_m[0], abs(prop.position_m[1] - y)
        if prop.tangible and 0.0 <= along_m <= length_m and aside_m <= cfg.aside_m:
            raise ValueError(
                f"playground {playground.name!r}: {prop.name!r} stands between the goal and the "
                "start of the attacker; choose playground=simple"
            )


def check_goal(cfg: SoccerCfg, playground: PlaygroundCfg) -> None:
    """Check that the goal fits between the boards across the corners of the first room.

    Raises:
        ValueError: If it does not.
    """
    room = playground.rooms[0]
    free_m = room.size_m[1] - 2.0 * _CORNER_M
    if cfg.goal_width_m > free_m:
        raise ValueError(
            f"playground {playground.name!r}: task.goal_width_m={cfg.goal_width_m:g} must be at "
            f"most {free_m:g} in room {room.name!r}, which is {room.size_m[1]:g} m wide with "
            f"boards of {_CORNER_M:g} m across its corners; choose a smaller goal, or "
            "playground=simple"
        )


class Pitch:
    """A pitch in the first room of a world, along x, with the goal at the end of greater x.

    Args:
        world: The world; ball, goal and boards are added to it.
        cfg: Parameters.

    Attributes:
        goal: Middle of the goal line on the floor, ``(3,)`` metres.
        goal_width_m: Distance between the axes of the posts.
        ball: The ball.
        low: Lower corner of the floor in front of the goal line, ``(2,)`` metres.
        high: Upper corner, ``(2,)`` metres.
    """

    def __init__(self, world: World, cfg: SoccerCfg) -> None:
        room = world.playground.rooms[0]
        low, size = np.array(room.lower_m), np.array(room.size_m)
        self._cfg, self.goal_width_m = cfg, cfg.goal_width_m
        self.goal: Floats = low + np.array([size[0] - cfg.goal_from_wall_m, size[1] / 2.0, 0.0])
        self.low: Floats = low[:2]
        self.high: Floats = np.array([self.goal[0], low[1] + size[1]])
        self.ball = self._add_ball(world)
        self._add_goal(world)
        self._add_boards(world)

    def scores(self, before: Floats, after: Floats) -> bool:
        """Return whether the centre of the ball has passed the goal line inside the goal.

        Args:
            before: Position of the ball, ``(3,)`` metres.
            after: Its position one step later, ``(3,)`` metres; the path is taken as straight.
        """
        if not before[0] < self.goal[0] <= after[0]:
            return False
        share = (self.goal[0] - before[0]) / (after[0] - before[0])
        _, aside, height = before + share * (after - before) - self.goal
        return bool(abs(aside) < self._cfg.goal_width_m / 2.0 and height < self._cfg.goal_height_m)

    def _add_ball(self, world: World) -> Prop:
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

    def _add_goal(self, world: World) -> None:
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

    def _add_boards(self, world: World) -> None:
        """Close the goal line beside the posts and cut the corners, which would trap the ball."""
        half_m = self._cfg.goal_width_m / 2.0
        centre = float(self.goal[1])
        for side, edge in (("right", self.low[1]), ("left", self.high[1])):
            inwards = math.copysign(1.0, centre - edge)
            post = np.array([self.goal[0], centre - inwards * half_m])
            corner = np.array([self.goal[0], edge])
            back = np.array([self.low[0], edge])
            along, across = np.array([_CORNER_M, 0.0]), np.array([0.0, _CORNER_M * inwards])
            _add_board(world, f"end_{side}", post, corner)
            _add_board(world, f"corner_{side}", corner - along, corner + across)
            _add_board(world, f"back_{side}", back + along, back + across)


def _add_board(world: World, name: str, start: Floats, end: Floats) -> None:
    """Add a low board between two points ``(2,)`` of the floor, from which a ball rebounds."""
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

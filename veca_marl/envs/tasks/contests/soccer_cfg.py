"""Parameters of the soccer tasks."""

from __future__ import annotations

import math
from dataclasses import dataclass

from veca_marl.envs.core.task import TaskCfg, terms

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

"""The pitch: what SoccerOnePlayer and SoccerTwoPlayer have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from veca_marl.envs.tasks.multi_agent.pitch import POST_M, Pitch

from veca_marl.envs.core.scoring import horizontal_angle_rad
from veca_marl.envs.core.task import Player, Task, TaskCfg, terms
from veca_marl.envs.tasks.multi_agent.contests import line_up, look_ahead
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats, horizontal_distance

ATTACKER, DEFENDER = "attacker", "defender"
_STRIDE_MPS = 0.1  # who stands does not kick: the ball bounces off


@dataclass
class SoccerCfg(TaskCfg):
    """The pitch lies along x: the goal's mouth looks back at the attacker.

    Attributes:
        radius_m: Radius of the ball.
        mass_kg: Mass of the ball.
        goal_width_m: Between the axes of the posts.
        goal_height_m: Of the bar.
        goal_from_wall_m: How far the goal line is before the end of the room.
        ball_from_goal_m: Least and greatest distance of the ball from the goal line at the start.
        aside_m: Ball and players start at most so far to the side of the middle line.
        attacker_from_ball_m: Least and greatest distance at which the attacker starts behind it.
        spread_deg: Players face the ball, up to so many degrees aside.
        kick_rest_s: Who has kicked cannot kick again before.
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
        for name in ("radius_m", "mass_kg", "goal_from_wall_m", "kick_rest_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"task.{name}={getattr(self, name)} must be a positive number")
        for name in ("goal_width_m", "goal_height_m"):
            if not 2.0 * (self.radius_m + POST_M) < getattr(self, name) < math.inf:
                raise ValueError(
                    f"task.{name}={getattr(self, name)}: a ball of task.radius_m={self.radius_m} "
                    "does not fit through"
                )
        for name in ("ball_from_goal_m", "attacker_from_ball_m"):
            near, far = getattr(self, name)
            if not 0.3 <= near <= far < math.inf:
                raise ValueError(
                    f"task.{name}={(near, far)} must be (least, greatest), 0.3 m or more"
                )
        if not 0.0 <= self.aside_m < math.inf:
            raise ValueError(f"task.aside_m={self.aside_m} must be 0 or more")
        if not 0.0 <= self.spread_deg <= 180.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 180]")


@dataclass(frozen=True)
class _Situation:
    """Where the ball is, seen from the goal and from the attacker.

    Attributes:
        ball: ``(3,)`` metres.
        to_goal_m: From the ball to the middle of the goal line.
        to_ball_m: From the attacker to the ball.
        aside_rad: From the attacker's forward direction to the way to the ball.
    """

    ball: Floats
    to_goal_m: float
    to_ball_m: float
    aside_rad: float


class Soccer(Task):
    """The attacker shall put the ball into the goal; there are no rules."""

    senses = ("vision", "touch", "proprioception")
    cfg: SoccerCfg

    def build(self) -> None:
        cfg, room = self.cfg, self.world.playground.rooms[0]
        self.pitch = Pitch(self.world, cfg)
        self.ball, self.goal = self.pitch.ball, self.pitch.goal
        length_m, width_m = cfg.ball_from_goal_m[1] + cfg.attacker_from_ball_m[1], 2.0 * cfg.aside_m
        if not self.pitch.holds(length_m, width_m):
            raise ValueError(
                f"task: {length_m} m of ball_from_goal_m and attacker_from_ball_m, {width_m} m of "
                f"aside_m do not fit into room {room.name!r} of {room.size_m[:2]} m"
            )
        self._rest_s: dict[str, float] = {}
        self._paid: dict[str, float] = {}
        self._scored = False
        self._now = self._look()

    def reset(self, rng: np.random.Generator) -> None:
        cfg = self.cfg
        back, aside = rng.uniform(*cfg.ball_from_goal_m), rng.uniform(-cfg.aside_m, cfg.aside_m)
        place = self.goal + np.array([-back, aside, cfg.radius_m])
        self.ball.place(place, rng.uniform(-math.pi, math.pi))
        for player in self.players:
            self._line_up(player, rng)
        look_ahead(self.players)
        self._rest_s = {player.name: 0.0 for player in self.players}
        self._scored = False
        self._now = self._look()

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        """Return where a player starts, ``(3,)`` metres; the attacker is behind the ball."""
        back = rng.uniform(*self.cfg.attacker_from_ball_m)
        aside = rng.uniform(-self.cfg.aside_m, self.cfg.aside_m)
        return np.array([self.ball.position[0] - back, self.goal[1] + aside, self.goal[2]])

    def after_step(self, rng: np.random.Generator) -> None:
        look_ahead(self.players)
        before, attacker = self._now, self.players[0].body.position
        self._now = self._look()
        self._scored = self._scored or self.pitch.scores(before.ball, self._now.ball)
        self._paid = {
            "goal": float(self._scored),
            "progress": before.to_goal_m - self._now.to_goal_m,
            "approach": before.to_ball_m - horizontal_distance(attacker, before.ball),
            "facing": before.aside_rad - self._now.aside_rad,
        }
        self._kick()

    def reward(self, player: Player) -> dict[str, float]:
        side = 1.0 if player.team == ATTACKER else -1.0
        return {term: side * value for term, value in self._paid.items()}

    def terminated(self) -> bool:
        return self._scored

    # ---- the ball

    def _look(self) -> _Situation:
        attacker, ball = self.players[0].body, self.ball.position
        way = ball - attacker.position
        return _Situation(
            ball,
            math.dist(ball[:2], self.goal[:2]),
            math.hypot(way[0], way[1]),
            horizontal_angle_rad(way, attacker.forward),
        )

    def _kick(self) -> None:
        """Let the nearest of those who walk at the ball kick it; one foot is enough for a step."""
        near = sorted(
            self.players, key=lambda p: horizontal_distance(p.body.position, self._now.ball)
        )
        self._rest_s = {name: s - self.world.clock.step_s for name, s in self._rest_s.items()}
        for player in near:
            body, rested = player.body, self._rest_s[player.name] <= 0.0
            strides = float(body.velocity @ body.forward) > _STRIDE_MPS
            if rested and strides and isinstance(body, Walker) and body.kick(self.ball):
                self._rest_s[player.name] = self.cfg.kick_rest_s
                return

    def _line_up(self, player: Player, rng: np.random.Generator) -> None:
        """Let a player face the ball, more or less."""
        spot = self.start(player, rng)
        way = self.ball.position - spot
        aside = math.radians(rng.uniform(-self.cfg.spread_deg, self.cfg.spread_deg))
        line_up(player, spot, math.atan2(way[1], way[0]) + aside)

"""Rules that SoccerOnePlayer and SoccerTwoPlayer share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.scoring import horizontal_angle_rad
from veca_marl.envs.core.task import Player, Task
from veca_marl.envs.tasks.contests.kicking import AutomaticKicks
from veca_marl.envs.tasks.contests.soccer_cfg import SoccerCfg
from veca_marl.envs.tasks.kickable_ball import check_kickable
from veca_marl.envs.tasks.player_starts import direct_gaze_ahead, place_player
from veca_marl.envs.tasks.soccer import Pitch, check_goal, check_start_area
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import PlaygroundCfg

ATTACKER, DEFENDER = "attacker", "defender"
_MOST_APPROACH_M = 10.0  # longer chases are not rewarded


@dataclass(frozen=True)
class _State:
    """Position of the ball relative to the goal and to the attacker.

    Attributes:
        ball: Position of the ball, ``(3,)`` metres.
        to_goal_m: Distance from the ball to the middle of the goal line.
        to_ball_m: Distance from the attacker to the ball.
        bearing_rad: Angle between the forward direction of the attacker and the direction of the
            ball.
    """

    ball: Floats
    to_goal_m: float
    to_ball_m: float
    bearing_rad: float


class Soccer(Task):
    """The attacker has to put the ball into the goal; nothing is forbidden."""

    senses = ("vision", "touch", "proprioception")
    cfg: SoccerCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_start_area(cfg, playground)
        check_goal(cfg, playground)

    def build(self) -> None:
        self.pitch = Pitch(self.world, self.cfg)
        self.ball, self.goal = self.pitch.ball, self.pitch.goal
        check_kickable(self.players, self.ball)
        self._kicks = AutomaticKicks(self.players, self.ball, self.cfg.kick_rest_s)
        self._terms: dict[str, float] = {}
        self._scored = False
        self._approached_m = 0.0
        self._state = self._observe_state()

    def reset(self, rng: np.random.Generator) -> None:
        cfg = self.cfg
        back, aside = rng.uniform(*cfg.ball_from_goal_m), rng.uniform(-cfg.aside_m, cfg.aside_m)
        position = self.goal + np.array([-back, aside, cfg.radius_m])
        self.ball.place(position, rng.uniform(-math.pi, math.pi))
        for player in self.players:
            self._place_facing_ball(player, rng)
        direct_gaze_ahead(self.players)
        self._kicks.reset()
        self._scored = False
        self._approached_m = 0.0
        self._state = self._observe_state()

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        """Return the start of a player, ``(3,)`` metres; the attacker is behind the ball."""
        back = rng.uniform(*self.cfg.attacker_from_ball_m)
        aside = rng.uniform(-self.cfg.aside_m, self.cfg.aside_m)
        return np.array([self.ball.position[0] - back, self.goal[1] + aside, self.goal[2]])

    def after_step(self, rng: np.random.Generator) -> None:
        direct_gaze_ahead(self.players)
        before, attacker = self._state, self.players[0].body.position
        self._state = self._observe_state()
        self._scored = self._scored or self.pitch.scores(before.ball, self._state.ball)
        self._terms = {
            "goal": float(self._scored),
            "progress": before.to_goal_m - self._state.to_goal_m,
            "approach": self._approach_m(
                before.to_ball_m - horizontal_distance(attacker, before.ball)
            ),
            "facing": before.bearing_rad - self._state.bearing_rad,
        }
        self._kicks.after_step(self.world.clock.step_s)

    def reward(self, player: Player) -> dict[str, float]:
        sign = 1.0 if player.team == ATTACKER else -1.0
        return {term: sign * value for term, value in self._terms.items()}

    def terminated(self) -> bool:
        return self._scored

    def solved(self, player: Player) -> bool:
        """Return whether a goal is scored; for a defender, whether none is scored."""
        return self._scored == (player.team == ATTACKER)

    def _approach_m(self, nearer_m: float) -> float:
        """Return by how much the sum of all approaches of the episode, if limited, has grown."""
        before_m, self._approached_m = self._approached_m, self._approached_m + nearer_m
        return min(self._approached_m, _MOST_APPROACH_M) - min(before_m, _MOST_APPROACH_M)

    def _observe_state(self) -> _State:
        attacker, ball = self.players[0].body, self.ball.position
        way = ball - attacker.position
        return _State(
            ball,
            math.dist(ball[:2], self.goal[:2]),
            math.hypot(way[0], way[1]),
            horizontal_angle_rad(way, attacker.forward),
        )

    def _place_facing_ball(self, player: Player, rng: np.random.Generator) -> None:
        start = self.start(player, rng)
        way = self.ball.position - start
        deviation = math.radians(rng.uniform(-self.cfg.spread_deg, self.cfg.spread_deg))
        place_player(player, start, math.atan2(way[1], way[0]) + deviation)

"""SoccerOnePlayer and SoccerTwoPlayer: put the ball into the goal of a pitch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import (
    Player,
    Task,
    Team,
    horizontal_angle_rad,
    register_task,
)
from veca_marl.envs.tasks.floors.places import direct_gaze_ahead, place_player
from veca_marl.envs.tasks.floors.playability import check_kickable
from veca_marl.envs.tasks.soccer_pitch import (
    CHILD_M,
    Pitch,
    SoccerCfg,
    check_goal,
    check_start_area,
)
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import PlaygroundCfg, Prop

_ROUNDING = 1e-6  # in agent steps
_LEAST_SPEED_MPS = 0.1  # a standing walker does not kick: it stops the ball


class AutomaticKicks:
    """Lets walkers kick a ball that is within reach of a foot while they walk forwards.

    In one step only the nearest player kicks. Joint-level bodies do not kick automatically.

    Args:
        players: All players.
        ball: The ball.
        rest_s: Least time between two kicks of a player.
    """

    def __init__(self, players: Sequence[Player], ball: Prop, rest_s: float) -> None:
        self._players, self._ball, self._rest_s = players, ball, rest_s
        self.reset()

    @property
    def steps_left(self) -> dict[str, int]:
        """Steps until each player can kick again; 0 if it can."""
        return {name: max(steps, 0) for name, steps in self._steps_left.items()}

    def reset(self) -> None:
        """Allow all players to kick."""
        self._steps_left = {player.name: 0 for player in self._players}

    def after_step(self, step_s: float) -> None:
        """Count a step of a duration and let one player kick if it can."""
        ball = self._ball.position
        nearest_first = sorted(
            self._players, key=lambda p: horizontal_distance(p.body.position, ball)
        )
        self._steps_left = {name: steps - 1 for name, steps in self._steps_left.items()}
        for player in nearest_first:
            if self._steps_left[player.name] <= 0 and self._kicks(player):
                self._steps_left[player.name] = math.ceil(self._rest_s / step_s - _ROUNDING)
                return

    def _kicks(self, player: Player) -> bool:
        """Let a player kick if it can; return whether it has."""
        body = player.body
        walks = float(body.velocity @ body.forward) > _LEAST_SPEED_MPS
        return walks and isinstance(body, Walker) and body.kick(self._ball)


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

    def state(self) -> dict[str, float]:
        step_s = self.world.clock.step_s
        rests = {f"{n}_rest_s": step_s * steps for n, steps in self._kicks.steps_left.items()}
        return {**rests, "approached_m": self._approached_m}

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


@register_task
class SoccerOnePlayer(Soccer):
    """A player starts behind a ball and has to put it into the goal at the end of the room.

    Nothing is forbidden. A goal is scored when the centre of the ball passes the goal line from
    the front, between the posts and under the bar; it terminates the episode, and the task is
    solved (`solved`). The player starts on hands and knees and pushes the ball. The paper (table of
    tasks in the appendix) says "put the ball into the goal with joint-level actions [...] there is
    no rule"; the numbers and all terms except `goal` are not in the paper. Departure: the eyes are
    turned to the horizon ahead in each step, because on hands and knees the face points to the
    floor.

    With `body=walker`, a variation that is not in the paper, the player walks; a ball within reach
    of its foot (`Walker.can_kick`) is kicked automatically, away from the body, at most once per
    `kick_rest_s`. A walker needs a third of the time (`task.max_seconds=20`).

    Terms:
        goal: 1 on the step in which the goal is scored, else 0.
        progress: Decrease during the step of the distance of the ball from the middle of the goal
            line, m.
        approach: Decrease during the step of the distance of the player from the ball's position
            before the step, m. It ignores the motion of the ball, so that kicking costs nothing; in
            an episode it adds up to at most 10, so that chasing the ball is worth less than a goal.
        facing: Decrease during the step of the angle between the player's forward direction and
            the direction of the ball, rad; over an episode it adds up to at most pi. It helps
            learning to look for the ball; its default weight is 0.
    """

    teams = (Team(ATTACKER),)


@dataclass
class SoccerTwoPlayerCfg(SoccerCfg):
    """Parameters of SoccerTwoPlayer. The pitch lies along x; the attacker shoots towards +x.

    Attributes:
        defender_from_goal_m: Least and greatest distance of the defender in front of the goal line
            at the start.
    """

    defender_from_goal_m: tuple[float, float] = (0.3, 0.8)

    def __post_init__(self) -> None:
        super().__post_init__()
        near, far = self.defender_from_goal_m
        apart_m = self.radius_m + CHILD_M
        if not 0.2 <= near <= far <= self.ball_from_goal_m[0] - apart_m:
            raise ValueError(
                f"task.defender_from_goal_m={(near, far)} must be (least, greatest), 0.2 m or "
                f"more, and {apart_m:g} m (task.radius_m and {CHILD_M} m from pelvis to head) "
                f"nearer than task.ball_from_goal_m={self.ball_from_goal_m}"
            )


@register_task
class SoccerTwoPlayer(Soccer):
    """SoccerOnePlayer with a defender between the ball and the goal.

    Nothing is forbidden: the defender may block and tackle, and both may push whatever they reach.
    With `body=walker`, a variation that is not in the paper, they walk and kick; of two walkers
    that reach the ball in one step the nearer one kicks. A goal, by
    either player, terminates the episode. The task is solved (`solved`) for the attacker when a
    goal is scored, and for the defender as long as none is. The paper (table of tasks in the
    appendix) says "the attacker must put the ball into the goal, and the defender must block the
    ball from the goal with joint-level actions [...] there is no rule"; the numbers and all terms
    except `goal` are not in the paper. Every term of the defender is minus that of the attacker
    (zero-sum). Departure: the eyes of players on hands and knees are turned to the horizon ahead in
    each step, as in SoccerOnePlayer.

    Terms:
        goal: 1 for the attacker on the step in which a goal is scored, else 0.
        progress: Decrease during the step of the distance of the ball from the middle of the goal
            line, m.
        approach: Decrease during the step of the distance of the attacker from the ball's position
            before the step, m. It ignores the motion of the ball, so that kicking costs nothing; in
            an episode it adds up to at most 10, so that chasing the ball is worth less than a goal.
            The defender is thus rewarded for standing in the attacker's path.
        facing: Decrease during the step of the angle between the attacker's forward direction and
            the direction of the ball, rad; over an episode it adds up to at most pi. It helps
            learning to look for the ball; its default weight is 0.
    """

    teams = (Team(ATTACKER), Team(DEFENDER))
    cfg: SoccerTwoPlayerCfg

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        if player.team == ATTACKER:
            return super().start(player, rng)
        back = rng.uniform(*self.cfg.defender_from_goal_m)
        half_m = min(self.cfg.aside_m, self.cfg.goal_width_m / 2.0)
        return np.array([self.goal[0] - back, self.goal[1] + rng.uniform(-half_m, half_m), 0.0])

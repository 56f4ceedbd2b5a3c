"""SoccerTwoPlayer: an attacker against a defender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Team, register_task
from veca_marl.envs.tasks.contests.soccer import ATTACKER, DEFENDER, Soccer
from veca_marl.envs.tasks.contests.soccer_cfg import CHILD_M, SoccerCfg
from veca_marl.sim.geometry import Floats


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

"""SoccerTwoPlayer: one wants the ball in the goal, the other does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Team, register
from veca_marl.envs.tasks.multi_agent.soccer import ATTACKER, DEFENDER, Soccer, SoccerCfg
from veca_marl.sim.geometry import Floats


@dataclass
class SoccerTwoPlayerCfg(SoccerCfg):
    """The pitch lies along x: the goal's mouth looks back at the attacker.

    Attributes:
        defender_from_goal_m: Least and greatest distance at which the defender starts before the
            goal line.
    """

    defender_from_goal_m: tuple[float, float] = (0.3, 0.8)

    def __post_init__(self) -> None:
        super().__post_init__()
        near, far = self.defender_from_goal_m
        if not 0.2 <= near <= far < self.ball_from_goal_m[0] - 0.3:
            raise ValueError(
                f"task.defender_from_goal_m={(near, far)} must be (least, greatest), 0.2 m or "
                f"more, and 0.3 m nearer than task.ball_from_goal_m={self.ball_from_goal_m}"
            )


@register
class SoccerTwoPlayer(Soccer):
    """The pitch of SoccerOnePlayer, with a defender between the ball and the goal.

    There are no rules: the defender may block and tackle, and both may kick and shove whatever
    they reach; of two walkers who reach the ball in one step the nearer one kicks. The game ends
    with a goal, whoever shot it; when the time is up the defender has held. The paper says "the
    attacker must put the ball into the goal, and the defender must block the ball from the goal
    [...] there is no rule"; the numbers and the helper terms are ours. What the attacker gets the
    defender loses: the game is zero-sum, every term by itself.

    Terms:
        goal: 1 for the attacker, -1 for the defender on the step the ball is in.
        progress: decrease in this step of the ball's distance from the middle of the goal line, m;
            minus that for the defender.
        approach: how much nearer the attacker has come in this step to where the ball was, m: a
            ball that rolls away costs nothing, or kicks would. Minus that for the defender, who is
            thus paid for standing in the attacker's way.
        facing: decrease in this step of the angle between the attacker's forward direction and the
            way to the ball, rad: at most pi in an episode, whatever is done; minus that for the
            defender. A helper for who learns to look for the ball; by default worth nothing.
    """

    teams = (Team(ATTACKER), Team(DEFENDER))
    cfg: SoccerTwoPlayerCfg

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        if player.team == ATTACKER:
            return super().start(player, rng)
        back = rng.uniform(*self.cfg.defender_from_goal_m)
        half_m = min(self.cfg.aside_m, self.cfg.goal_width_m / 2.0)
        return np.array([self.goal[0] - back, self.goal[1] + rng.uniform(-half_m, half_m), 0.0])

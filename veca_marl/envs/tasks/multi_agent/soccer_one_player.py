"""SoccerOnePlayer: put the ball into the goal."""

from __future__ import annotations

from veca_marl.envs.core.task import Team, register
from veca_marl.envs.tasks.multi_agent.soccer import ATTACKER, Soccer


@register
class SoccerOnePlayer(Soccer):
    """A ball, a goal at the end of the room, and a player who starts behind the ball.

    There are no rules: the player may use whatever it has. The ball is in when its centre passes
    the goal line between the posts and under the bar, from the front; then the episode ends. A
    ball within reach of a walker's foot (`Walker.can_kick`) is kicked by itself, away from the
    body, at most twice a second; joint-level bodies start on hands and knees and push. The paper
    says "put the ball into the goal with joint-level actions" and no more: the numbers and the
    helper terms are ours.

    Terms:
        goal: 1 on the step the ball is in.
        progress: decrease in this step of the ball's distance from the middle of the goal line, m.
        approach: how much nearer the player has come in this step to where the ball was, m: a ball
            that rolls away costs nothing, or kicks would.
        facing: decrease in this step of the angle between the player's forward direction and the
            way to the ball, rad: at most pi in an episode, whatever is done. A helper for who
            learns to look for the ball; by default it is worth nothing.
    """

    teams = (Team(ATTACKER),)

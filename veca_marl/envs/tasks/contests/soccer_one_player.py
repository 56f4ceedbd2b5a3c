"""SoccerOnePlayer: put the ball into the goal."""

from __future__ import annotations

from veca_marl.envs.core.task import Team, register_task
from veca_marl.envs.tasks.contests.soccer import ATTACKER, Soccer


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

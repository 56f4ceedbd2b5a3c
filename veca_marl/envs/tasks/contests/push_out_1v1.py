"""PushOut1v1: push the opponent out of the ring."""

from __future__ import annotations

from veca_marl.envs.core.task import Team, register_task
from veca_marl.envs.tasks.contests.push_out import PushOut


@register_task
class PushOut1v1(PushOut):
    """Two players in a ring that is painted on the floor; the player that leaves it loses.

    They start on opposite sides and face the middle, up to `spread_deg` to the side. A player
    is out when its pelvis is beyond the rim, whether it was pushed or not, and the episode
    terminates. The task is solved (`solved`) for a player that is in the ring when its opponent is
    out; when the time is over neither has won. The paper (table of tasks in the appendix;
    "Multi-Agent Reinforcement Learning") says "the agent must push other agents out of the ring
    to win", with joint-level actions; the ring, the start and the reward are not in the paper.
    Every term is zero-sum over `push` and `out` together and over `ground`.

    The players start on hands and knees. Departure: their eyes are turned to the horizon ahead in
    each step, because on hands and knees the face points to the floor. With `body=walker`, a
    variation that is not in the paper, they walk: two walkers in contact push each other with the
    speeds at which they walk towards each other; face to face they hold each other, from behind or
    from the side one moves the other at half its speed.

    Terms:
        push: 1 on the step in which the opponent is out, else 0.
        out: -1 on the step in which the player itself is out, else 0.
        ground: Decrease during the step of the share of the ring's area that is nearer to the
            middle than the player, minus that of the opponent. It is the difference of a
            potential: its sum over an episode depends only on the first and the last positions.
    """

    teams = (Team("red", shirt=1), Team("blue", shirt=0))

"""PushOut1v1: push the other one out of the ring."""

from __future__ import annotations

from veca_marl.envs.core.task import Team, register
from veca_marl.envs.tasks.multi_agent.push_out import PushOut


@register
class PushOut1v1(PushOut):
    """Two players face each other in a ring that is painted on the floor; who leaves it loses.

    They start on opposite sides, facing the middle up to 30 degrees aside. Who has the pelvis
    beyond the rim is out, pushed or not, and the game is over; nobody wins when the time is up.
    The paper says "the agent must push other agents out of the ring to win" and no more: the
    ring, the start and the reward are ours. The game is zero-sum, every term by itself.

    Two walkers who meet push each other with the speed at which each walks at the other: face to
    face they hold each other, from behind or from the side one shoves the other at half its speed.

    Terms:
        push: 1 on the step the opponent is out.
        out: -1 on the step the player itself is out.
        ground: ground won in this step and lost by the opponent: the decrease of the share of the
            ring's area that is nearer to the middle than the player, minus the opponent's. A
            potential: over an episode it pays for the last place alone, not for the way.
    """

    teams = (Team("red", shirt=1), Team("blue", shirt=0))

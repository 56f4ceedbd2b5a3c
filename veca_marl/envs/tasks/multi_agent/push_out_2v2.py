"""PushOut2v2: push both of the others out of the ring."""

from __future__ import annotations

from veca_marl.envs.core.task import Player, Team, register
from veca_marl.envs.tasks.multi_agent.push_out import PushOut


@register
class PushOut2v2(PushOut):
    """Two teams of two face each other in a ring; a team of which nobody is left loses.

    The rules of PushOut1v1 for each of the four. Who is out stays out, where it left the ring, and
    its mate plays on alone. Teams start abreast on opposite sides. What a team is paid is divided
    among those who still play, so that the sum over all four is zero at every step, term by term
    (`push` and `out` together).

    Terms:
        push: number of opponents who are out since this step, divided by the number of the
            player's team who played until this step.
        out: -1 on the step the player itself is out.
        ground: ground won by the team in this step and lost by the others, divided likewise: the
            decrease of the share of the ring's area that is nearer to the middle than a player,
            on average over those who played until this step, minus that of the others.
    """

    teams = (Team("red", 2, shirt=1), Team("blue", 2, shirt=0))
    eliminates = True

    def is_eliminated(self, player: Player) -> bool:
        return player.name in self._fallen

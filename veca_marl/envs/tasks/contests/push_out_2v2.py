"""PushOut2v2: push both opponents out of the ring."""

from __future__ import annotations

from veca_marl.envs.core.task import Player, Team, register_task
from veca_marl.envs.tasks.contests.push_out import PushOut


@register_task
class PushOut2v2(PushOut):
    """Two teams of two players in a ring; a team without players in the ring loses.

    The rules of PushOut1v1 apply to each player. An eliminated player stays where it left the
    ring, and its teammate continues alone. The task is solved (`solved`) for both players of a team
    when both opponents are out and the team is not. The players of a team start side by side. The
    paper (table of tasks in the appendix) says "agents must push agents of the opponent team out of
    the ring to win"; the rest is not in the paper. Terms are divided by the size of a full team: a
    push has the same reward with and without a mate, and a mate's exit costs the other one half as
    much as its own, so that pushing the own mate out is never rewarded. The sum over all players is
    not zero. Departure: the eyes of players on hands and knees are turned to the horizon ahead in
    each step, as in PushOut1v1.

    Terms:
        push: Number of opponents that are out since this step, divided by 2.
        out: On the step in which the player itself is out, minus the number of players that its
            team had until this step, divided by 2; on a step in which only its mate is out, -0.5.
            The sum over an episode is thus -1 for a player that is out, whatever its mate does.
        ground: Decrease during the step of the share of the ring's area that is nearer to the
            middle than a player, summed over the players that the team had until this step, minus
            that of the opponents, divided by 2.
    """

    teams = (Team("red", 2, shirt=1), Team("blue", 2, shirt=0))
    eliminates = True

    def is_eliminated(self, player: Player) -> bool:
        return player.name in self._newly_out

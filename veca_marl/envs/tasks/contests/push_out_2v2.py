"""PushOut2v2: push both opponents out of the ring."""

from __future__ import annotations

from veca_marl.envs.core.task import Player, Team, register
from veca_marl.envs.tasks.contests.push_out import PushOut


@register
class PushOut2v2(PushOut):
    """Two teams of two players in a ring; a team without players in the ring loses.

    The rules of PushOut1v1 apply to each player. An eliminated player stays where it left the
    ring, and its teammate continues alone. The task is solved (`solved`) for both players of a team
    when both opponents are out and the team is not. The players of a team start side by side. The
    paper (table of tasks in the appendix) says "agents must push agents of the opponent team out of
    the ring to win"; the rest is not in the paper. Rewards of a team are divided by the number of
    its remaining players, so that the sum over all four players is zero in every step, for `ground`
    and for `push` and `out` together.

    Terms:
        push: Number of opponents that are out since this step, divided by the number of players
            that the player's team had until this step.
        out: -1 on the step in which the player itself is out, else 0.
        ground: Mean decrease during the step, over the players that the team had until this step,
            of the share of the ring's area that is nearer to the middle than a player, minus the
            mean of the opponents, divided by the same number as `push`.
    """

    teams = (Team("red", 2, shirt=1), Team("blue", 2, shirt=0))
    eliminates = True

    def is_eliminated(self, player: Player) -> bool:
        return player.name in self._newly_out

"""Getting back onto hands and knees after a fall, for bodies that crawl."""

from __future__ import annotations

from veca_marl.envs.experts.control.crawling.get_up import GetUp
from veca_marl.sim.body.humanoid import Humanoid, JointCommand

# vertical component of the front of the chest: -1 on the belly, 1 on the back; at most -0.6 in 20 s
# of crawling, pushing and dribbling
_FALLEN = -0.3
_PATIENCE_S = 0.4  # a body that rolls over by itself has not fallen


class FallRecovery:
    """Notices that a body lies on its back or on a side, and gets it up onto hands and knees.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._get_up = GetUp(body, step_s)
        self._fallen_s, self._is_rising = 0.0, False

    def command(self) -> JointCommand | None:
        """Return the target angles of the next step; None for a body that has not fallen.

        Call it once per step.
        """
        if not self._is_rising and self._has_fallen():
            self._is_rising = True
            self._get_up.reset()
        if not self._is_rising:
            return None
        command = self._get_up.command()
        self._is_rising = not self._get_up.is_complete
        return command

    def _has_fallen(self) -> bool:
        is_down = self._body.bone("chest").forward[2] > _FALLEN
        self._fallen_s = self._fallen_s + self._step_s if is_down else 0.0
        return self._fallen_s >= _PATIENCE_S

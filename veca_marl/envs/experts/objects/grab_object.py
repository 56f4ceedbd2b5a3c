"""Expert of GrabObject: lift the toy between both palms."""

from __future__ import annotations

from collections.abc import Iterator

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.palm_motion import PalmMotion
from veca_marl.envs.experts.objects.carrying_expert import CarryingExpert
from veca_marl.envs.experts.skills.lifting import BENT, UPRIGHT, lift
from veca_marl.envs.tasks.objects.grab_object import GrabObject
from veca_marl.sim.geometry import Floats

_LIFT_M = 0.10


@register_expert("GrabObject")
class GrabObjectExpert(CarryingExpert[GrabObject]):
    """Presses the toy between both palms and lifts it; starts again after losing it.

    Reads the poses of the toy and of its own bones, and the angles, velocities and strengths of its
    joints from the simulator (privileged); with position control also the forces on its joints.
    Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: GrabObject, player: Player) -> None:
        step_s = task.world.clock.step_s
        palms = PalmMotion(task.child, step_s, UPRIGHT, BENT, posture_gain_per_s=0.25)
        super().__init__(task, player, palms)

    def _script(self) -> Iterator[Floats]:
        height_m = self.task.cfg.edge_m / 2 + _LIFT_M
        return lift(self.task.child, self._palms, self.task.toy, height_m)

"""ObjectPhysNav: ObjectNav with a joint-level body."""

from __future__ import annotations

from dataclasses import dataclass

from veca_marl.envs.core.task import register_task, require_humanoid
from veca_marl.envs.tasks.navigation.object_nav import ObjectNav, ObjectNavCfg
from veca_marl.sim.body.humanoid import HumanoidCfg


@dataclass
class ObjectPhysNavCfg(ObjectNavCfg):
    """Parameters of ObjectPhysNav: those of ObjectNav, for a body that crawls.

    Attributes:
        reach_m: As in ObjectNav. It is larger, because the head and hands of a body on hands and
            knees are in front of its pelvis.
        apart_m: As in ObjectNav. It is larger, because a body that crawls needs floor to turn.
    """

    max_seconds: float = 60.0
    reach_m: float = 0.5
    apart_m: float = 2.0


@register_task
class ObjectPhysNav(ObjectNav):
    """ObjectNav with a body that is controlled by its joints and starts on hands and knees.

    Objects, rewards and the end of an episode are as in ObjectNav: the task is solved (`solved`)
    when the target has been reached. The agent feels and senses its own body as well. Senses and
    joint-level actions are those of the paper (table of tasks in the appendix); sizes and times are
    not in the paper. Departures: those of ObjectNav's helper reward; the eyes are turned to the
    horizon ahead in each step, because on hands and knees the face points to the floor.

    Terms:
        reached: 1 on the step in which the target is reached, else 0.
        wrong: 1 on the step in which another object is reached, and the target is not, else 0.
        ahead: Displacement forwards during the step, m (negative backwards), while the target is
            visible to the agent's eyes. In the paper ``Vis a_f``. Its sum
            has no bound: walking in a circle near the object is paid too.
        turn: Decrease of the horizontal angle between the agent's forward direction and the
            direction of the target since the target was last visible, rad, if it is visible after
            the step. In the paper ``Vis a_l L``, see `HelperReward`.
    """

    senses = ("vision", "touch", "proprioception")
    body_cfg = HumanoidCfg
    cfg: ObjectPhysNavCfg

    def build(self) -> None:
        require_humanoid(self.players[0])
        super().build()

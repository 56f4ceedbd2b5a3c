"""The joint-level body: an articulated multibody driven by joint torques."""

from veca_marl.sim.body.humanoid.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import (
    SATURATION_RAD,
    JointActionKind,
    JointChoice,
    JointCommand,
)
from veca_marl.sim.body.humanoid.postures import Posture

__all__ = [
    "SATURATION_RAD",
    "Detail",
    "Humanoid",
    "HumanoidCfg",
    "JointActionKind",
    "JointChoice",
    "JointCommand",
    "Posture",
]

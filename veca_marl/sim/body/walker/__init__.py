"""The walking body: a capsule in the physics, bones posed by forward kinematics."""

from veca_marl.sim.body.walker.actions import Applied, WalkActionKind, WalkCommand
from veca_marl.sim.body.walker.walker import Walker
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg

__all__ = ["Applied", "WalkActionKind", "WalkCommand", "Walker", "WalkerCfg"]

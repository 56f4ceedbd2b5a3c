"""The walking body: a capsule in the physics, bones posed by forward kinematics."""

from veca_marl.sim.body.walker.actions.verb_part import Applied
from veca_marl.sim.body.walker.actions.walk_commands import WalkActionKind, WalkCommand
from veca_marl.sim.body.walker.walker import Walker
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg

__all__ = ["Applied", "WalkActionKind", "WalkCommand", "Walker", "WalkerCfg"]

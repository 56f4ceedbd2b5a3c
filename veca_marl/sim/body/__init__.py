"""Bodies: a humanoid that walks by kinematics, and one whose joints are driven in physics.

`Body` is the base class; `make_body` makes one from its configuration; `register_body` adds a kind.
"""

from veca_marl.sim.body.action import VoiceKind
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.registry import BODIES, make_body, register_body
from veca_marl.sim.body.sense_organs import MOUNTS

__all__ = ["BODIES", "MOUNTS", "Body", "BodyCfg", "VoiceKind", "make_body", "register_body"]

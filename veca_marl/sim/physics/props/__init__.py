"""Props: what they are made from, their shapes, their bodies in Bullet, and where they are."""

from veca_marl.sim.physics.props.joint import JointCfg, JointKind, LockCfg
from veca_marl.sim.physics.props.planned_prop import PlannedProp, StandingProp
from veca_marl.sim.physics.props.prop import Prop, copy_all_poses, follow_physics
from veca_marl.sim.physics.props.prop_cfg import (
    SIZE_NAMES,
    PartCfg,
    PropCfg,
    PropShape,
    check_appearance,
)
from veca_marl.sim.physics.props.rigid_body import limit_detection
from veca_marl.sim.physics.props.sleeping import prop_sleep

__all__ = [
    "SIZE_NAMES",
    "JointCfg",
    "JointKind",
    "LockCfg",
    "PartCfg",
    "PlannedProp",
    "Prop",
    "PropCfg",
    "PropShape",
    "StandingProp",
    "check_appearance",
    "copy_all_poses",
    "follow_physics",
    "limit_detection",
    "prop_sleep",
]

"""The PyBullet world, its clock, its props and playgrounds."""

from veca_marl.sim.physics.bullet import (
    are_in_contact,
    create_collision_shape,
    is_contact,
    penetration_m,
    shape_arguments,
    urdf_geometry,
)
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.houses.furniture import FurnitureCfg, FurnitureKind
from veca_marl.sim.physics.houses.random_house import RandomHouseCfg
from veca_marl.sim.physics.houses.walls import WallsCfg
from veca_marl.sim.physics.playground import PLAYGROUND_GENERATORS, PlaygroundCfg
from veca_marl.sim.physics.props import (
    SIZE_NAMES,
    JointCfg,
    JointKind,
    LockCfg,
    PartCfg,
    PlannedProp,
    Prop,
    PropCfg,
    PropShape,
    StandingProp,
)
from veca_marl.sim.physics.rooms import DoorCfg, LeafCfg, RoomCfg
from veca_marl.sim.physics.world import GRAVITY_MPS2, Mover, World

__all__ = [
    "JointCfg",
    "JointKind",
    "LeafCfg",
    "LockCfg",
    "PartCfg",
    "GRAVITY_MPS2",
    "PLAYGROUND_GENERATORS",
    "SIZE_NAMES",
    "BulletClient",
    "ClockCfg",
    "DoorCfg",
    "FurnitureCfg",
    "FurnitureKind",
    "Mover",
    "PlannedProp",
    "PlaygroundCfg",
    "Prop",
    "PropCfg",
    "PropShape",
    "RandomHouseCfg",
    "RoomCfg",
    "StandingProp",
    "WallsCfg",
    "World",
    "are_in_contact",
    "create_collision_shape",
    "is_contact",
    "penetration_m",
    "pybullet",
    "shape_arguments",
    "urdf_geometry",
]

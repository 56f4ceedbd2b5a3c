"""The PyBullet world, its clock, its props and playgrounds."""

from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.collision_shapes import (
    create_collision_shape,
    shape_arguments,
    urdf_geometry,
)
from veca_marl.sim.physics.mover import Mover
from veca_marl.sim.physics.playground import PlaygroundCfg
from veca_marl.sim.physics.props import SIZE_NAMES, Prop, PropCfg, PropShape
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg
from veca_marl.sim.physics.world import GRAVITY_MPS2, World

__all__ = [
    "GRAVITY_MPS2",
    "SIZE_NAMES",
    "ClockCfg",
    "DoorCfg",
    "Mover",
    "PlaygroundCfg",
    "Prop",
    "PropCfg",
    "PropShape",
    "RoomCfg",
    "World",
    "create_collision_shape",
    "pybullet",
    "shape_arguments",
    "urdf_geometry",
]

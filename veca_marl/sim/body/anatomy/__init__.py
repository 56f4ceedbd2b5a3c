"""The skeleton, its kinematics, its skin mesh and its URDF."""

from veca_marl.sim.body.anatomy.growth import REFERENCE, Growth, growth_at, growth_of_height
from veca_marl.sim.body.anatomy.kinematics import (
    Soles,
    Underside,
    bone_motion,
    forward_kinematics,
    rotate_about_axis,
)
from veca_marl.sim.body.anatomy.link_shapes import (
    SkinLayer,
    SkinSpring,
    is_finger,
    skin_layer,
    skin_spring,
)
from veca_marl.sim.body.anatomy.skeleton import Bone, Joint, Skeleton, limit_sources, load_skeleton
from veca_marl.sim.body.anatomy.skin_mesh import binding_pose, load_skin
from veca_marl.sim.body.anatomy.urdf import BodyFiles, Build, body_files, bone_of

__all__ = [
    "REFERENCE",
    "BodyFiles",
    "Bone",
    "Build",
    "Growth",
    "Joint",
    "Skeleton",
    "SkinLayer",
    "SkinSpring",
    "Soles",
    "Underside",
    "binding_pose",
    "body_files",
    "bone_motion",
    "bone_of",
    "forward_kinematics",
    "growth_at",
    "growth_of_height",
    "is_finger",
    "limit_sources",
    "load_skeleton",
    "load_skin",
    "rotate_about_axis",
    "skin_layer",
    "skin_spring",
]

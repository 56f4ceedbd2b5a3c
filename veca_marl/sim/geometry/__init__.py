"""Shared geometry: primitives, polyhedra, the scene, poses, rotations, distances, rays, meshes."""

from veca_marl.sim.geometry.inertia import Inertia, joined_inertia, primitive_inertia
from veca_marl.sim.geometry.meshes import Indices, Mesh, MeshTable, empty_meshes, with_mesh
from veca_marl.sim.geometry.polyhedra import Polyhedron, convex_hull, pyramid, sector_of_disc
from veca_marl.sim.geometry.poses import Floats, Pose
from veca_marl.sim.geometry.primitives import (
    Primitive,
    Shape,
    bounding_radius,
    capsule_between,
)
from veca_marl.sim.geometry.rotations import (
    cross,
    heading_rad,
    matrix_to_quaternion,
    quaternion_from_yaw,
    quaternions_to_matrices,
    rotation_about_vertical,
    rotation_with_z,
)
from veca_marl.sim.geometry.scene import Scene, SceneObject
from veca_marl.sim.geometry.signed_distances import (
    DistanceAndGradient,
    distance,
    distance_and_gradient,
    is_inside,
)
from veca_marl.sim.geometry.skinning import deform_meshes
from veca_marl.sim.geometry.solids import (
    Solid,
    distances_to,
    solid_distance,
    solid_entry,
    solid_gradient,
    solid_of,
)
from veca_marl.sim.geometry.tables import Bools, Geom, GeomTable, SurfaceTable
from veca_marl.sim.geometry.vectors import Vector, horizontal_distance, single

__all__ = [
    "solid_entry",
    "solid_of",
    "solid_gradient",
    "solid_distance",
    "sector_of_disc",
    "pyramid",
    "convex_hull",
    "Polyhedron",
    "Bools",
    "DistanceAndGradient",
    "Floats",
    "Geom",
    "GeomTable",
    "Indices",
    "Inertia",
    "Mesh",
    "MeshTable",
    "Pose",
    "Primitive",
    "Scene",
    "SceneObject",
    "Shape",
    "Solid",
    "SurfaceTable",
    "Vector",
    "bounding_radius",
    "capsule_between",
    "cross",
    "deform_meshes",
    "distance",
    "distance_and_gradient",
    "distances_to",
    "empty_meshes",
    "heading_rad",
    "horizontal_distance",
    "is_inside",
    "joined_inertia",
    "matrix_to_quaternion",
    "primitive_inertia",
    "quaternion_from_yaw",
    "quaternions_to_matrices",
    "rotation_about_vertical",
    "rotation_with_z",
    "single",
    "with_mesh",
]

"""Scenes with the skin of a body in given poses."""

import numpy as np

from veca_marl.sim.body.anatomy import (
    REFERENCE,
    binding_pose,
    forward_kinematics,
    load_skeleton,
    load_skin,
)
from veca_marl.sim.body.appearance import bone_geoms, dressed_skin
from veca_marl.sim.geometry import (
    deform_meshes,
    empty_meshes,
    quaternions_to_matrices,
    with_mesh,
)
from veca_marl.sim.touch.taxels import BARYCENTRIC, distance_to_bone

SHIRT = (0.2, 0.4, 0.9)


def random_angles(rng, share=1.0):
    """Random joint angles ``(82,)`` within a fraction of their ranges."""
    limits = np.array([(j.low_rad, j.high_rad) for j in load_skeleton().joints])
    return share * rng.uniform(limits[:, 0], limits[:, 1])


def random_turn(rng):
    turn = np.empty((1, 3, 3))
    quaternion = rng.normal(size=(1, 4))
    quaternions_to_matrices(quaternion / np.linalg.norm(quaternion), turn)
    return turn[0]


def add_body(scene, name="body"):
    """Add a body in its zero pose, pelvis at the origin."""
    skeleton = load_skeleton()
    item = scene.add_object(name, bone_geoms(skeleton, SHIRT), dressed_skin(skeleton, SHIRT))
    pose(item, np.zeros(82))
    return item


def pose(item, angles, position=(0.0, 0.0, 0.0), rotation=None):
    """Set the pose and joint angles of a body without updating the scene."""
    item.positions[0] = position
    item.rotations[0] = np.eye(3) if rotation is None else rotation
    forward_kinematics(load_skeleton(), angles, item.positions, item.rotations)


def limb_of(bone):
    """The part of the body that moves as a tube of its own: trunk, arm, leg, foot or one finger."""
    side, _, part = bone.partition("_")
    first = part.partition("_")[0]
    arms_and_legs = {
        "upper": "arm",
        "forearm": "arm",
        "hand": "arm",
        "thigh": "leg",
        "shank": "leg",
    }
    return f"{side}_{arms_and_legs.get(first, first)}" if side in ("l", "r") else "trunk"


def heights_above_the_felt_skin(growth=REFERENCE):
    """Bones of the taxels that are not hidden in another limb, and metres above their limb's skin.

    In the pose that the mesh is bound in. The skin of a limb is the surface of its primitives with
    the flexible skin on; hidden is what is 2 mm deep in that of another limb.
    """
    skeleton, mesh = load_skeleton(growth), load_skin(growth)
    positions, rotations = binding_pose(skeleton)
    bound = with_mesh(empty_meshes(), mesh, 0)
    deform_meshes(bound, positions, rotations)
    corners = bound.vertices[mesh.triangles]
    points = np.einsum("bk,tkc->tbc", BARYCENTRIC, corners).reshape(-1, 3)
    owners = np.repeat(mesh.owners, len(BARYCENTRIC))
    limbs = np.array([limb_of(bone.name) for bone in skeleton.bones])
    heights, hidden = np.full(len(points), np.inf), np.zeros(len(points), bool)
    for index, bone in enumerate(skeleton.bones):
        local = (points - positions[index]) @ rotations[index]
        above = distance_to_bone(bone, local) - bone.skin_thickness_m
        own = limbs[owners] == limbs[index]
        heights = np.where(own, np.minimum(heights, above), heights)
        hidden |= ~own & (above < -0.002)
    return owners[~hidden], heights[~hidden]

"""Scenes with the skin of a body in given poses."""

import numpy as np

from veca_marl.sim.body.anatomy import forward_kinematics, load_skeleton
from veca_marl.sim.body.appearance import bone_geoms, dressed_skin
from veca_marl.sim.geometry import quaternions_to_matrices

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

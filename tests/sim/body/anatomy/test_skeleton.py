"""The table of the body and its forward kinematics, computed in three ways."""

import numpy as np
import pytest
from refusals import naming
from scipy.spatial.transform import Rotation

from veca_marl.sim.body.anatomy import Soles, forward_kinematics, load_skeleton
from veca_marl.sim.geometry import Shape
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet

SKELETON = load_skeleton()
LOW = np.array([joint.low_rad for joint in SKELETON.joints])
HIGH = np.array([joint.high_rad for joint in SKELETON.joints])


def pose(angles, place=(0.0, 0.0, 0.0), turn=None):
    positions, rotations = np.zeros((47, 3)), np.tile(np.eye(3), (47, 1, 1))
    positions[0], rotations[0] = place, np.eye(3) if turn is None else turn
    forward_kinematics(SKELETON, angles, positions, rotations)
    return positions, rotations


def random_angles(seed):
    return np.random.default_rng(seed).uniform(LOW, HIGH)


def test_counts_and_mass():
    assert len(SKELETON.bones) == 47
    assert len(SKELETON.joints) == 82
    assert sum(bone.mass_kg for bone in SKELETON.bones) == pytest.approx(10.0, abs=0.1)
    assert sum(bone.joint_count for bone in SKELETON.bones) == 82


def test_parents_come_first():
    assert SKELETON.bones[0].name == "pelvis"
    assert all(bone.parent < index for index, bone in enumerate(SKELETON.bones))
    assert [bone.parent for bone in SKELETON.bones].count(-1) == 1


def test_joints_follow_their_bones():
    for bone in SKELETON.bones:
        own = SKELETON.joints[bone.first_joint : bone.first_joint + bone.joint_count]
        assert all(joint.bone == bone.name for joint in own)


def test_standing_is_within_the_limits():
    assert ((LOW <= 0.0) & (HIGH >= 0.0)).all()


def test_left_and_right_are_mirror_images():
    mirror = np.array([1.0, -1.0, 1.0])
    for bone in SKELETON.bones:
        if bone.name.startswith("l_"):
            other = SKELETON.bones[SKELETON.bone("r_" + bone.name[2:])]
            np.testing.assert_allclose(np.array(bone.origin) * mirror, other.origin, atol=1e-12)
            assert bone.mass_kg == other.mass_kg
            assert bone.joint_count == other.joint_count


def test_forward_kinematics_equals_plain_matrices():
    turn = Rotation.from_euler("zyx", [0.7, 0.2, -0.4]).as_matrix()
    for seed in range(5):
        angles = random_angles(seed)
        positions, rotations = pose(angles, (0.3, -0.2, 0.5), turn)
        frames = [np.eye(4)]
        frames[0][:3, :3], frames[0][:3, 3] = turn, (0.3, -0.2, 0.5)
        for bone in SKELETON.bones[1:]:
            local = np.eye(4)
            local[:3, :3], local[:3, 3] = bone.rest_rotation, bone.origin
            for index in range(bone.first_joint, bone.first_joint + bone.joint_count):
                hinge = np.eye(4)
                axis = np.array(SKELETON.joints[index].axis)
                hinge[:3, :3] = Rotation.from_rotvec(axis * angles[index]).as_matrix()
                local = local @ hinge
            frames.append(frames[bone.parent] @ local)
        np.testing.assert_allclose(positions, [f[:3, 3] for f in frames], atol=1e-9)
        np.testing.assert_allclose(rotations, [f[:3, :3] for f in frames], atol=1e-9)


def bullet_chain(client):
    """The same body as PyBullet links: one per hinge, and one fixed link where a bone has none."""
    parents, origins, turns, kinds, axes, last = [], [], [], [], [], {0: 0}
    for index, bone in enumerate(SKELETON.bones[1:], start=1):
        hinges = SKELETON.joints[bone.first_joint : bone.first_joint + bone.joint_count]
        parent = last[bone.parent]
        for order in range(max(len(hinges), 1)):
            parents.append(parent)
            origins.append(bone.origin if order == 0 else (0.0, 0.0, 0.0))
            turn = (
                Rotation.from_matrix(bone.rest_rotation).as_quat() if order == 0 else (0, 0, 0, 1)
            )
            turns.append(list(turn))
            kinds.append(pybullet.JOINT_REVOLUTE if hinges else pybullet.JOINT_FIXED)
            axes.append(hinges[order].axis if hinges else (0.0, 0.0, 1.0))
            parent = len(parents)
        last[index] = parent
    count = len(parents)
    body = client.createMultiBody(
        1.0,
        linkMasses=[1.0] * count,
        linkCollisionShapeIndices=[-1] * count,
        linkVisualShapeIndices=[-1] * count,
        linkPositions=[list(o) for o in origins],
        linkOrientations=turns,
        linkInertialFramePositions=[[0, 0, 0]] * count,
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * count,
        linkParentIndices=parents,
        linkJointTypes=kinds,
        linkJointAxis=[list(a) for a in axes],
        flags=pybullet.URDF_MAINTAIN_LINK_ORDER,
    )
    return body, kinds, {bone: link - 1 for bone, link in last.items()}


def test_forward_kinematics_equals_pybullets():
    client = BulletClient()
    body, kinds, last_link = bullet_chain(client)
    angles = random_angles(11)
    hinges = [link for link, kind in enumerate(kinds) if kind == pybullet.JOINT_REVOLUTE]
    assert len(hinges) == 82
    for link, angle in zip(hinges, angles, strict=True):
        client.resetJointState(body, link, angle)
    positions, rotations = pose(angles)
    for bone in range(1, 47):  # Bullet's own sines are good to about 1e-7
        state = client.getLinkState(body, last_link[bone], computeForwardKinematics=True)
        np.testing.assert_allclose(positions[bone], state.position, atol=1e-6)
        turn = np.reshape(pybullet.getMatrixFromQuaternion(state.orientation), (3, 3))
        np.testing.assert_allclose(rotations[bone], turn, atol=1e-6)
    client.close()


def test_bones_keep_their_lengths():
    for seed in range(3):
        positions, rotations = pose(random_angles(seed))
        for index, bone in enumerate(SKELETON.bones[1:], start=1):
            length = np.linalg.norm(positions[index] - positions[bone.parent])
            assert length == pytest.approx(np.linalg.norm(bone.origin), abs=1e-12)
        np.testing.assert_allclose(
            rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (47, 1, 1)), atol=1e-12
        )


def test_the_lowest_point_of_the_soles_is_that_of_a_dense_sample():
    angles = random_angles(4)
    positions, rotations = pose(angles)
    lowest = np.inf
    ball = Rotation.random(4000, random_state=0).apply([1.0, 0.0, 0.0])
    for name in ("l_foot", "r_foot"):
        frame = SKELETON.bone(name)
        for part in SKELETON.bones[frame].colliders:
            if part.shape is Shape.BOX:
                points = np.array(part.offset) + np.sign(ball) * part.size
            else:
                points = np.concatenate([end + part.radius * ball for end in part.cap_centres()])
            world = positions[frame] + points @ rotations[frame].T
            lowest = min(lowest, world[:, 2].min())
    assert Soles(SKELETON).lowest_m(positions, rotations) == pytest.approx(lowest, abs=1e-4)


def test_unknown_names_are_answered_with_those_there_are():
    with pytest.raises(KeyError, match=naming("'tail'", "'pelvis'")):
        SKELETON.bone("tail")
    with pytest.raises(KeyError, match=naming("head.roll", "head.rotation")):
        SKELETON.joint("head", "roll")


def test_the_table_is_read_once():
    assert load_skeleton() is SKELETON

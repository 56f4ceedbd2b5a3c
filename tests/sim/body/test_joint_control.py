"""The `joints` part of an action: torques, target angles, increments of target angles."""

import math

import numpy as np
import pytest
from humanoids import remove_gravity
from refusals import naming
from walking import let_pass

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Detail, JointActionKind, JointChoice
from veca_marl.sim.body.humanoid.joint_control import PositionControl
from veca_marl.sim.body.humanoid.postures import POSTURES, Posture, posture_angles

SKELETON = load_skeleton()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_positive_torque_turns_a_joint_to_its_positive_side(make_child, sign):
    world, body = make_child()
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0))
    for name in ("l_forearm.flexion", "r_upper_arm.abduction", "head.rotation"):
        body.place((0.0, 0.0, 2.0), 0.0, _middle())
        before = body.joint_angles()
        torques = np.zeros(82)
        torques[body.joint_names.index(name)] = 0.1 * sign
        body.apply_torque(torques)
        let_pass(world, 0.12)
        moved = (body.joint_angles() - before)[body.joint_names.index(name)]
        assert moved * sign > 0.01, name


def _middle():
    return np.array([(joint.low_rad + joint.high_rad) / 2 for joint in SKELETON.joints])


def test_torques_last_until_the_next_action_and_are_zero_after_a_reset(make_child):
    world, body = make_child()
    row = np.random.default_rng(0).uniform(-1, 1, 82)
    body.act({"joints": row})
    let_pass(world, 0.2)
    np.testing.assert_array_equal(body.joint_torques(), row)
    world.reset(np.random.default_rng(0))
    world.step()
    assert not body.joint_torques().any()


def test_joints_move_to_target_angles(make_child):
    world, body = make_child(action=JointActionKind.position)
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0))
    bent = {"upper_arm.abduction": 60.0, "forearm.flexion": 50.0, "thigh.flexion": 30.0}
    bent |= {"head.rotation": -30.0, "spine.lateral": 10.0, "l_index_middle.flexion": 40.0}
    wanted = posture_angles(SKELETON, Posture(0.0, bent))
    body.act(body.encode(wanted))
    let_pass(world, 2.0)
    np.testing.assert_allclose(body.joint_angles(), wanted, atol=math.radians(2.0))


def test_target_angles_keep_a_sitting_posture(make_child):
    world, body = make_child(action=JointActionKind.position, detail=Detail.mitten)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES["sitting"])
    wanted = posture_angles(SKELETON, POSTURES["sitting"])
    body.act(body.encode(wanted))
    head_m = body.bone("head").position[2]
    let_pass(world, 4.0)
    assert body.bone("head").position[2] > 0.85 * head_m


@pytest.mark.parametrize("detail", Detail)
def test_encoded_torques_keep_a_sitting_posture_without_oscillation(make_child, detail):
    """They are computed once per agent step."""
    world, body = make_child(action=JointActionKind.torque, detail=detail)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES["sitting"])
    wanted = body.posture_angles(POSTURES["sitting"])
    head_m = body.bone("head").position[2]
    for _ in range(150):
        body.act(body.encode(wanted))
        world.step()
    assert body.bone("head").position[2] > 0.85 * head_m
    assert np.abs(body.velocities()).max() < 0.1


def test_increments_of_zero_hold_a_posture(make_child):
    world, body = make_child(action=JointActionKind.increment, detail=Detail.mitten)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES["sitting"])
    head_m = body.bone("head").position[2]
    for _ in range(100):
        body.act({"joints": np.zeros(82)})
        world.step()
    assert body.bone("head").position[2] > 0.85 * head_m


def test_increments_add_up_to_targets(make_child):
    world, body = make_child(action=JointActionKind.increment)
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0))
    bent = {"forearm.flexion": 50.0, "thigh.flexion": 30.0, "head.rotation": -30.0}
    wanted = posture_angles(SKELETON, Posture(0.0, bent))
    rows = []
    for _ in range(50):
        rows.append(body.encode(wanted)["joints"])
        body.act({"joints": rows[-1]})
        world.step()
    np.testing.assert_allclose(body.joint_angles(), wanted, atol=math.radians(2.0))
    assert np.abs(rows[0]).max() > 0.0
    np.testing.assert_allclose(rows[-1], 0.0, atol=1e-6)


def test_increments_are_clipped_at_the_limits_and_reset_by_place(make_child):
    world, body = make_child(action=JointActionKind.increment)
    remove_gravity(world)
    for _ in range(3):
        body.place((0.0, 0.0, 2.0))
        elbow = body.joint_names.index("l_forearm.flexion")
        row = np.zeros(82)
        row[elbow] = 1.0
        for _ in range(12):
            body.act({"joints": row})
            world.step()
        bent = body.joint_angles()[elbow]
        assert bent > 0.9 * SKELETON.joints[elbow].high_rad
        body.act({"joints": -row})  # what was commanded beyond the limit does not accumulate
        world.step()
        body.act({"joints": -row})
        world.step()
        assert body.joint_angles()[elbow] < bent - math.radians(5.0)


def test_set_points_and_targets_are_inverse(make_child):
    _, body = make_child(action=JointActionKind.position)
    angles = np.random.default_rng(0).uniform(body._low, body._high)
    control = PositionControl()
    set_points = control.set_points(angles, angles, body._low, body._high)
    torques = control.torques(set_points, angles, body._low, body._high)
    np.testing.assert_allclose(torques, 0.0, atol=1e-9)


def test_the_action_may_leave_out_the_fingers(make_child):
    world, body = make_child(joints=JointChoice.limbs)
    assert body.action_spec["joints"].shape == (40,)
    body.act({"joints": np.full(40, 0.5)})
    world.step()
    fingers = [i for i, name in enumerate(body.joint_names) if "thumb" in name or "index" in name]
    assert not body.joint_torques()[fingers].any()
    assert (body.joint_torques() != 0.0).sum() == 40


def test_the_action_may_move_the_arms_alone(make_child):
    """All other joints are held at the angles at which the body was placed."""
    world, body = make_child(action=JointActionKind.increment, joints=JointChoice.arms)
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0), 0.0, POSTURES["sitting"])
    before = body.joint_angles()
    body.act({"joints": np.full(14, 0.5)})
    let_pass(world, 0.4)
    moved = np.abs(body.joint_angles() - before)
    bones = [name.partition(".")[0] for name in body.joint_names]
    arms = np.array([bone.endswith(("_upper_arm", "_forearm", "_hand")) for bone in bones])
    assert body.action_spec["joints"].names == tuple(np.array(body.joint_names)[arms])
    assert moved[arms].min() > 0.01
    assert moved[~arms].max() < 0.05


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        (np.zeros(81), ("'joints'", "(81,)", "(82,)")),
        (np.full(82, np.nan), ("'joints'", "spine.flexion", "nan")),
        (np.full(82, np.inf), ("'joints'", "spine.flexion", "inf")),
        (np.full(82, 1.01), ("'joints'", "spine.flexion", "1.01")),
    ],
)
def test_impossible_actions_are_refused(make_child, row, parts):
    _, body = make_child()
    with pytest.raises(ValueError, match=naming(*parts)):
        body.act({"joints": row})
    with pytest.raises(ValueError, match=naming(*parts)):
        body.apply_torque(row)


def test_apply_torque_needs_a_torque_controlled_body(make_child):
    _, body = make_child(action=JointActionKind.position)
    with pytest.raises(ValueError, match=naming("apply_torque", "body.action=torque")):
        body.apply_torque(np.zeros(82))

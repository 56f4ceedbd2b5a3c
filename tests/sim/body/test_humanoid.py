"""The joint-level body: names, placing, physics, resets and palms."""

import math
from pathlib import Path

import numpy as np
import pytest
from humanoids import random_torques
from refusals import naming
from walking import empty_world, let_pass

from veca_marl.sim.body import MOUNTS, Body, BodyCfg, make_body
from veca_marl.sim.body.anatomy import Underside, load_skeleton, skin_spring
from veca_marl.sim.body.humanoid import (
    Detail,
    Humanoid,
    HumanoidCfg,
    JointActionKind,
)
from veca_marl.sim.body.humanoid.postures import (
    ON_BACK,
    ON_BELLY,
    POSTURES,
    Posture,
    posture_angles,
)
from veca_marl.sim.body.sense_organs import EYES

SKELETON = load_skeleton()
ALL = [bone.name for bone in SKELETON.bones]


# ---- names and counts


@pytest.mark.parametrize("detail", Detail)
def test_both_details_have_47_bones_and_82_joints(make_child, detail):
    _, body = make_child(detail=detail)
    assert len(body.bone_names) == len(set(body.bone_names)) == 47
    assert len(body.joint_names) == len(set(body.joint_names)) == 82
    assert body.velocities().shape == body.angular_velocities().shape == (47, 3)
    for read in (body.joint_angles, body.joint_velocities, body.joint_torques):
        assert read().shape == (82,)
    assert len(body.articulation.moving) == {Detail.full: 82, Detail.mitten: 40}[detail]
    for mount in MOUNTS:
        assert np.isfinite(body.mount(mount).position).all()


@pytest.mark.parametrize("head_turn_deg", [0.0, 25.0, -25.0])
@pytest.mark.parametrize("depth_m", [0.0, 0.03, 0.06])
def test_eyes_stay_above_the_floor_and_apart(make_child, depth_m, head_turn_deg):
    _, body = make_child()
    neck = {"neck.flexion": 20.0, "neck.rotation": head_turn_deg}
    face_down = Posture(90.0, {**ON_BELLY.joints_deg, **neck})
    body.place((0.0, 0.0, 1.0), posture=face_down)
    above = [body.mount(eye) for eye in EYES]
    body.place((0.0, 0.0, -depth_m), posture=face_down)
    eyes = [body.mount(eye) for eye in EYES]
    assert min(eye.position[2] for eye in eyes) > 0.0049
    np.testing.assert_allclose(
        eyes[0].position - eyes[1].position, above[0].position - above[1].position, atol=1e-9
    )
    lowest = min(eye.position[2] for eye in above) - 1.0 - depth_m
    raised = max(0.005 - lowest, 0.0)
    assert (raised > 0.0) == (depth_m > 0.0)
    for one, other in zip(eyes, above, strict=True):
        assert one.position[2] == pytest.approx(other.position[2] - 1.0 - depth_m + raised)
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-9)


def test_it_is_made_by_its_configuration():
    world = empty_world()
    body: Body = make_body("child", HumanoidCfg(), world)
    assert isinstance(body, Humanoid)
    with pytest.raises(ValueError, match=naming("BodyCfg", "WalkerCfg")):
        make_body("nobody", BodyCfg(), world)
    world.close()


# ---- placing and reading


@pytest.mark.parametrize("name", sorted(POSTURES))
@pytest.mark.parametrize("height_m", [0.0, 0.4])
def test_the_lowest_point_is_at_the_height_of_the_place(make_child, name, height_m):
    world, body = make_child()
    body.place((1.0, -2.0, height_m), 0.8, POSTURES[name])
    world.refresh()
    lowest = Underside(SKELETON, ALL, skin=True).lowest_m(
        body.bone_positions(), body.bone_rotations()
    )
    assert lowest == pytest.approx(height_m, abs=1e-9)
    np.testing.assert_allclose(body.position[:2], (1.0, -2.0), atol=1e-9)
    expected = posture_angles(SKELETON, POSTURES[name])
    np.testing.assert_allclose(body.joint_angles(), expected, atol=1e-12)
    np.testing.assert_allclose(body.forward, (math.cos(0.8), math.sin(0.8), 0.0), atol=1e-9)


def test_velocities_equal_those_of_bullet(make_child):
    world, body = make_child()
    client, body_id = world.client, body.body_id
    for _ in random_torques(world, [body], 1.0):
        pass
    velocities, spins = body.velocities(), body.angular_velocities()
    assert np.abs(spins).max() > 5.0
    for link in range(client.getNumJoints(body_id)):
        name = client.getJointInfo(body_id, link).link_name.decode()
        if name not in body.bone_names:
            continue
        state = client.getLinkState(body_id, link, 1, 1)
        bone = body.bone_names.index(name)
        lever = np.subtract(state.centre, state.position)  # Bullet gives that of the centre of mass
        np.testing.assert_allclose(spins[bone], state.angular_velocity, atol=1e-6)
        np.testing.assert_allclose(
            velocities[bone] + np.cross(spins[bone], lever), state.velocity, atol=1e-3
        )


def test_fingers_of_a_mitten_are_straight_and_follow_the_hand(make_child):
    world, body = make_child(detail=Detail.mitten)
    for _ in random_torques(world, [body], 1.0):
        pass
    hand, finger = body.bone("l_hand"), body.bone("l_index_distal")
    local = hand.rotation.T @ (finger.position - hand.position)
    full_world, full = make_child()
    full_world.refresh()
    hand, finger = full.bone("l_hand"), full.bone("l_index_distal")
    np.testing.assert_allclose(
        local, hand.rotation.T @ (finger.position - hand.position), atol=1e-9
    )
    fingers = np.setdiff1d(np.arange(82), body.articulation.moving)
    assert not body.joint_angles()[fingers].any()
    assert not body.joint_torques()[fingers].any()


@pytest.mark.parametrize(
    ("position", "posture", "parts"),
    [
        ((0.0, 0.0, math.nan), ON_BACK, ("(0.0, 0.0, nan)",)),
        ((0.0, 0.0), ON_BACK, ("(0.0, 0.0)",)),
        ((0.0, 0.0, 0.0), Posture(0.0, {"knee.flexion": 5.0}), ("'knee.flexion'",)),
        (
            (0.0, 0.0, 0.0),
            Posture(0.0, {"l_shank.flexion": -5.0}),
            ("l_shank.flexion", "-5 degrees", "148"),
        ),
        ((0.0, 0.0, 0.0), np.full(82, np.nan), ("spine.flexion", "nan")),
        ((0.0, 0.0, 0.0), np.zeros(40), ("angles", "(40,)", "(82,)")),
    ],
)
def test_impossible_places_are_refused(make_child, position, posture, parts):
    _, body = make_child()
    with pytest.raises(ValueError, match=naming(*parts)):
        body.place(position, 0.0, posture)


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"detail": "stick"}, ("body.detail='stick'", "full", "mitten")),
        ({"action": "muscles"}, ("body.action='muscles'", "torque", "position")),
        ({"joints": "some"}, ("body.joints='some'",)),
        ({"strength": 0.0}, ("body.strength=0.0",)),
        ({"strength": 2.0}, ("body.strength=2.0",)),
        ({"eye_range_deg": -1.0}, ("body.eye_range_deg=-1.0",)),
    ],
)
def test_impossible_parameters_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        HumanoidCfg(**numbers)


# ---- physics


def test_a_fall_is_a_free_fall(make_child):
    world, body = make_child()
    body.place((0.0, 0.0, 1.0))
    start = body.position[2]
    let_pass(world, 0.2)
    assert body.velocity[2] == pytest.approx(-9.81 * 0.2, rel=0.01)
    assert body.position[2] - start == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=0.06)


def test_fingers_palms_and_soles_are_compliant(make_child):
    world, body = make_child()
    client, body_id = world.client, body.body_id
    stiff = {}
    for link in range(client.getNumJoints(body_id)):
        name = client.getJointInfo(body_id, link).link_name.decode()
        stiff[name] = client.getDynamicsInfo(body_id, link).contact_stiffness
    for name in ("l_hand__skin", "r_foot__skin", "l_index_distal"):
        bone = SKELETON.bones[SKELETON.bone(name.removesuffix("__skin"))]
        assert stiff[name] == pytest.approx(skin_spring(bone).stiffness_npm)
    assert stiff["l_hand"] == stiff["chest"] < 0.0, "Bullet's value for rigid"


def test_loaded_skin_is_compressed_by_hookes_law(make_child):
    """At every contact of the hands and feet of a sitting body with the floor."""
    world, body = make_child(action=JointActionKind.position)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES["sitting"])
    wanted = posture_angles(SKELETON, POSTURES["sitting"])
    body.act(body.encode(wanted))
    let_pass(world, 6.0)
    client, body_id = world.client, body.body_id
    pressed = 0
    for point in client.getContactPoints(body_id, world.floor_id):
        stiffness = client.getDynamicsInfo(body_id, point.link_a).contact_stiffness
        if stiffness > 0.0 and point.normal_force_n > 0.5:
            assert point.normal_force_n == pytest.approx(-stiffness * point.distance_m, rel=0.04)
            pressed += 1
    assert pressed >= 2


@pytest.mark.slow
def test_ten_thousand_resets_allocate_no_memory(make_child):
    world, body = make_child(detail=Detail.mitten)

    def resident_kb():
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4

    def reset(times):
        for _ in range(times):
            world.reset(np.random.default_rng(0))
            body.place((0.0, 0.0, 0.0), 0.1, ON_BACK)

    if not Path("/proc/self/statm").exists():
        pytest.skip("memory is read from /proc")
    reset(500)
    before = resident_kb()
    reset(10_000)
    assert resident_kb() - before < 1000


def test_many_resets_do_not_change_an_episode(make_child):
    world, body = make_child(detail=Detail.mitten)

    def episode():
        world.reset(np.random.default_rng(0))
        body.place((0.0, 0.0, 0.0), 0.3, ON_BACK)
        return [body.bone_positions() for _ in random_torques(world, [body], 0.4)]

    first = episode()
    for _ in range(200):
        world.reset(np.random.default_rng(0))
    np.testing.assert_array_equal(episode(), first)


@pytest.mark.parametrize("what", ["base", "joint"])
def test_a_body_with_nan_is_reported_and_shows_finite_numbers(make_child, what):
    world, body = make_child()
    world.step()
    nan = math.nan
    if what == "base":
        world.client.resetBaseVelocity(body.body_id, (nan,) * 3, (0, 0, 0))
    else:
        world.client.resetJointStatesMultiDof(body.body_id, [3], [[nan]], [[0.0]])
    assert body.is_finite
    world.step()
    assert not body.is_finite
    for seen in (body.bone_positions(), body.velocities(), body.joint_angles(), body.position):
        assert np.isfinite(seen).all()
    world.reset(np.random.default_rng(0))
    assert not body.is_finite, "Bullet's collision detection does not recover"


# ---- palms


def test_palms_are_on_the_inside_of_both_hands(make_child):
    _, body = make_child()
    body.place((0.0, 0.0, 0.0))
    left, right = body.palms()
    for palm, side in ((left, "l"), (right, "r")):
        wrist = body.bone(f"{side}_hand").position
        assert 0.0 < wrist[2] - palm[2] < 0.05
    # a standing body's palms face its thighs
    assert 0.0 < body.bone("l_hand").position[1] - left[1] < 0.02
    assert 0.0 < right[1] - body.bone("r_hand").position[1] < 0.02

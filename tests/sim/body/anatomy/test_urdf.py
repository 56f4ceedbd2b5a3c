"""The URDF of the body: counts, order, masses, limits; and Bullet reads it as we mean it."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.anatomy import (
    Build,
    SkinLayer,
    body_files,
    bone_of,
    load_skeleton,
    skin_layer,
    skin_spring,
)
from veca_marl.sim.body.anatomy.link_shapes import MARGIN_M
from veca_marl.sim.body.anatomy.urdf import _Writer
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.geometry import Shape
from veca_marl.sim.physics.bullet_client import pybullet

SKELETON = load_skeleton()
LOW = np.array([joint.low_rad for joint in SKELETON.joints])
HIGH = np.array([joint.high_rad for joint in SKELETON.joints])


@pytest.fixture(scope="module")
def robots():
    return {
        fingers: ET.fromstring(body_files(SKELETON, Build(fingers)).urdf)
        for fingers in (True, False)
    }


@pytest.fixture(params=Detail)
def humanoid(request):
    world = empty_world()
    yield Humanoid("child", HumanoidCfg(detail=request.param), world)
    world.close()


def names(robot, tag, kind=None):
    return [e.get("name") for e in robot.iter(tag) if kind in (None, e.get("type"))]


def test_47_bones_36_light_links_4_skins_13_further_shapes_and_82_hinges(robots):
    links = names(robots[True], "link")
    assert len(links) == len(set(links)) == 47 + 36 + 4 + 13
    bones = {bone.name for bone in SKELETON.bones}
    assert {bone_of(link) for link in links} & bones == bones
    assert set(links) >= {bone.name for bone in SKELETON.bones}
    assert sorted(names(robots[True], "joint", "revolute")) == sorted(
        f"{joint.bone}.{joint.label}" for joint in SKELETON.joints
    )


def test_with_fingers_no_link_has_two_shapes_and_most_are_taken_as_they_are(robots):
    """Bullet wraps a shape up where its frame is not that of the inertia."""
    alone = 0
    for link in robots[True].findall("link"):
        shapes = link.findall("collision")
        assert len(shapes) <= 1
        for shape in shapes:
            alone += shape.find("origin").attrib == link.find("inertial/origin").attrib
    assert alone >= 45
    # pelvis, spine, chest, shanks, and the toes with their skins
    parts = [name for name in names(robots[True], "link") if "__part" in name]
    assert len(parts) == 2 + 2 + 3 + 2 + 4


def test_the_mitten_has_40_hinges_and_no_finger(robots):
    assert len(names(robots[False], "joint", "revolute")) == 40
    assert not [
        name for name in names(robots[False], "link") if "_thumb_" in name or "index" in name
    ]


@pytest.mark.parametrize("fingers", [True, False])
def test_parents_are_written_before_their_children(robots, fingers):
    known = names(robots[fingers], "link")
    for joint in robots[fingers].findall("joint"):
        parent, child = (joint.find(end).get("link") for end in ("parent", "child"))
        assert known.index(parent) < known.index(child)


@pytest.mark.parametrize("fingers", [True, False])
def test_ten_kilograms_and_no_impossible_inertia(robots, fingers):
    masses = [float(mass.get("value")) for mass in robots[fingers].iter("mass")]
    assert sum(masses) == pytest.approx(10.0, abs=1e-9)
    assert min(masses) > 0.0
    for inertia in robots[fingers].iter("inertia"):
        x, y, z = sorted(float(inertia.get(key)) for key in ("ixx", "iyy", "izz"))
        assert 0.0 < x <= y <= z < x + y


def test_bullet_reads_the_table(humanoid):
    client, body = humanoid._world.client, humanoid.articulation
    for joint in range(client.getNumJoints(body.body_id)):
        info = client.getJointInfo(body.body_id, joint)
        if info.kind != pybullet.JOINT_REVOLUTE:
            continue
        ours = SKELETON.joints[humanoid.joint_names.index(info.name.decode())]
        assert (info.lower_limit, info.upper_limit, info.max_force) == (
            ours.low_rad,
            ours.high_rad,
            ours.torque_nm,
        )
        assert info.parent < joint


def test_bones_are_where_bullet_has_them(humanoid):
    client, body = humanoid._world.client, humanoid.body_id
    count = client.getNumJoints(body)
    links = {client.getJointInfo(body, link).link_name.decode(): link for link in range(count)}
    for seed in range(20):
        rng = np.random.default_rng(seed)
        humanoid.place(rng.uniform(0.0, 2.0, 3), rng.uniform(-3.0, 3.0), rng.uniform(LOW, HIGH))
        for name, link in links.items():
            if name in humanoid.bone_names:
                state = client.getLinkState(body, link, computeForwardKinematics=1)
                turn = np.reshape(pybullet.getMatrixFromQuaternion(state.orientation), (3, 3))
                bone = humanoid.bone(name)
                np.testing.assert_allclose(bone.position, state.position, atol=1e-6)
                np.testing.assert_allclose(bone.rotation, turn, atol=5e-6)


def shapes_of_bullet(humanoid):
    """Kind, centre and rotation of every collision shape, by bone, out of Bullet."""
    where, client = humanoid.body_id, humanoid._world.client
    shapes = {}
    for link in range(-1, client.getNumJoints(where)):
        if link < 0:
            name = humanoid.bone_names[0]
            frame = client.getBasePositionAndOrientation(where)
        else:
            name = bone_of(client.getJointInfo(where, link).link_name.decode())
            state = client.getLinkState(where, link, 0, 1)
            frame = (state.centre, state.centre_orientation)
        for shape in client.getCollisionShapeData(where, link):
            place, turn = pybullet.multiplyTransforms(*frame, *shape[5:7])
            turn = np.reshape(pybullet.getMatrixFromQuaternion(turn), (3, 3))
            bone = shapes.setdefault(name.partition("__")[0], [])
            bone.append((shape[2], np.array(place), turn))
    return shapes


def test_what_things_meet_is_where_it_is_drawn(humanoid):
    """Centres and axes of rods and boxes; hulls are in the frames of their bones."""
    scene = humanoid._world.scene
    rng = np.random.default_rng(0)
    humanoid.place(rng.uniform(0.0, 2.0, 3), 0.7, rng.uniform(LOW, HIGH))
    humanoid._world.refresh()
    drawn, shapes = scene.objects[humanoid.object_id], shapes_of_bullet(humanoid)
    for row in range(drawn.rows.start, drawn.rows.stop):
        bone = humanoid.bone_names[scene.geoms.frames[row] - drawn.rows.start]
        if not scene.geoms.tangible[row] or bone not in shapes:
            continue  # eyes are only seen, and fingers of a mitten are in the hulls of its hands
        centre, axis = scene.geoms.positions[row], scene.geoms.rotations[row][:, 2]
        found = 0
        for kind, place, turn in shapes[bone]:
            if kind == pybullet.GEOM_MESH:
                frame = humanoid.bone(bone)
                np.testing.assert_allclose(place, frame.position, atol=1e-5)
                np.testing.assert_allclose(turn, frame.rotation, atol=1e-5)
            elif np.allclose(place, centre, atol=1e-5):
                assert abs(turn[:, 2] @ axis) == pytest.approx(1.0, abs=1e-5), bone
            else:
                continue
            found += 1
        assert found, bone


def reach(bone, frame, skin_m, ways):
    """How far the primitives of a bone at a pose stand out along directions ``(n, 3)``, metres."""
    local = ways @ frame.rotation
    farthest = []
    for part in bone.colliders:
        if part.shape is Shape.BOX:
            far = local @ np.array(part.offset) + np.abs(local) @ (np.array(part.size) + skin_m)
        else:
            ends = np.stack([local @ end for end in part.cap_centres()])
            far = ends.max(axis=0) + part.radius + skin_m
        farthest.append(far)
    return np.max(farthest, axis=0) + ways @ frame.position


def test_hulls_of_a_mitten_reach_as_far_as_what_is_in_them():
    files = body_files(SKELETON, Build(fingers=False))
    assert {name.removesuffix(".obj") for name in files.hulls} == {
        "pelvis",
        "spine",
        "chest",
        *(
            f"{side}_{part}"
            for side in "lr"
            for part in ("shank", "foot", "foot__skin", "hand__skin", "hand__thumb")
        ),
    }
    ways = np.random.default_rng(0).normal(size=(500, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    writer = _Writer(SKELETON, Build(fingers=False))
    for name, content in files.hulls.items():
        link = name.removesuffix(".obj")
        index = [bone.name for bone in SKELETON.bones].index(link.partition("__")[0])
        soft, thumb = "__" in link, link.endswith("__thumb")
        expected = np.max(
            [
                reach(part, pose, part.skin_thickness_m if soft else 0.0, ways)
                for part, pose in writer._members(index)
                if (soft or skin_layer(part) is not SkinLayer.SKIN)
                and ("thumb" in part.name) == thumb
            ],
            axis=0,
        )
        points = [line.split()[1:] for line in content.splitlines() if line.startswith("v")]
        got = (ways @ np.array(points, float).T).max(axis=1) + MARGIN_M
        # Bullet rounds the corners of boxes by its margin, by 0.73 mm at most
        np.testing.assert_allclose(got, expected, atol=8e-4, err_msg=link)


def test_bodies_of_equal_builds_share_their_files():
    files = body_files(SKELETON, Build(strength=0.5))
    assert body_files(SKELETON, Build(strength=0.5)) is files
    assert body_files(SKELETON, Build(strength=0.6)).urdf != files.urdf


def test_only_hands_feet_and_fingers_are_soft(robots):
    soft = {
        bone_of(link.get("name"))
        for link in robots[True].findall("link")
        if link.find("contact/stiffness") is not None
    }
    assert soft == {b.name for b in SKELETON.bones if skin_layer(b) is not SkinLayer.BONE}
    assert len(soft) == 4 + 30


def test_the_spring_reaches_the_bone_under_the_force_of_the_table():
    for bone in SKELETON.bones:
        spring = skin_spring(bone)
        assert spring.stiffness_npm * spring.thickness_m == pytest.approx(bone.skin_force_n)
        assert spring.damping_nspm > 0.0

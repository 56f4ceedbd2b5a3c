"""The penetration model: proportionality, superposition, symmetry, and a dense reference."""

import itertools

import numpy as np
import pytest
from skins import add_body, pose, random_angles, random_turn
from touching import SPREAD, Stage, dense, of_bone

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid.articulation import may_collide
from veca_marl.sim.geometry import Shape
from veca_marl.sim.touch import TouchCfg, load_taxels, taxel_positions
from veca_marl.sim.touch.penetration import empty_workspace, read_taxels
from veca_marl.sim.touch.rigid_bones import rigid_bones
from veca_marl.sim.touch.taxels import fields_of
from veca_marl.sim.touch.touch_sense import unsensed_bones, unsensed_primitives


def press_forearm(stage, depth_m, radius=0.04, side="l"):
    """Press a ball into the middle of a forearm from the front (its x axis) to a given depth."""
    name = f"{side}_forearm"
    bone = load_skeleton().bones[stage.bone(name)]
    capsule = bone.colliders[0]
    assert capsule.shape is Shape.CAPSULE
    away = capsule.radius + bone.skin_thickness_m + radius - depth_m
    return stage.add("SPHERE", (radius,), stage.at(name, (away, 0.0, -0.0475)))


def test_without_contact_all_readings_are_exactly_zero():
    stage = Stage()
    stage.add("SPHERE", (0.1,), (0.5, 0.0, 0.0))
    stage.add("BOX", (1.0, 1.0, 0.1), (0.0, 0.0, -0.6))
    assert not stage.read().any()


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.75, 1.0])
def test_the_reading_is_the_penetration_relative_to_the_skin_thickness(share):
    """On a round limb the deepest taxel reads depth / d_max, except for its own offset."""
    stage = Stage()
    thickness = load_skeleton().bones[stage.bone("l_forearm")].skin_thickness_m
    press_forearm(stage, share * thickness, radius=0.5)
    assert of_bone(stage.read(), "l_forearm").max() == pytest.approx(share, abs=0.06)


def test_a_rising_floor_raises_the_readings_of_the_soles_in_proportion():
    """The toes are the lowest part of the foot; the readings of the heel rise by as much."""
    stage = Stage()
    thickness = load_skeleton().bones[stage.bone("l_foot")].skin_thickness_m
    lowest = stage.at("l_foot", (0.0, 0.0, -0.0345 - 0.0042))[2] - thickness
    floor = stage.add("BOX", (2.0, 2.0, 0.05), (0.0, 0.0, 0.0))
    readings = []
    for share in (0.5, 0.8):
        floor.positions[0] = (0.0, 0.0, lowest + share * thickness - 0.05)
        readings.append(of_bone(stage.read(), "l_foot"))
        assert readings[-1].max() == pytest.approx(share, abs=0.04)
    risen = (readings[1] - readings[0])[(readings[0] > 0.05) & (readings[1] < 1.0)]
    assert len(risen) > 40
    assert np.median(risen) == pytest.approx(0.3, abs=0.02)


def test_contact_with_the_bone_reads_one():
    stage = Stage()
    press_forearm(stage, 0.008, radius=0.5)
    readings = of_bone(stage.read(), "l_forearm")
    assert readings.max() == pytest.approx(1.0, abs=0.03)
    assert readings.max() <= 1.0


def test_readings_do_not_decrease_with_depth():
    before = np.zeros((1648, 6))
    for depth in (0.001, 0.002, 0.004):
        stage = Stage()
        press_forearm(stage, depth, radius=0.5)
        now = stage.read()
        assert (now >= before - 1e-3).all()
        assert now.sum() > before.sum()
        before = now


def test_two_separate_contacts_are_the_sum_of_each_alone():
    alone = []
    for sides in ("l", "r", "lr"):
        stage = Stage()
        for side in sides:
            press_forearm(stage, 0.003, side=side)
        alone.append(stage.read())
    left, right, both = alone
    assert left.any()
    assert right.any()
    assert not ((left > 0) & (right > 0)).any()
    np.testing.assert_array_equal(both, left + right)


def test_of_two_primitives_on_one_taxel_the_larger_reading_counts():
    readings = []
    for depths in ((0.002,), (0.004,), (0.002, 0.004)):
        stage = Stage()
        for depth in depths:
            press_forearm(stage, depth)
        readings.append(stage.read())
    one, other, both = readings
    np.testing.assert_array_equal(both, np.maximum(one, other))


def test_mirrored_contacts_give_mirrored_readings():
    """Mirrored in the median plane; the vertex order of a mirrored triangle is reversed."""
    readings = []
    for side, sign in (("l", 1.0), ("r", -1.0)):
        stage = Stage()
        hand = stage.at(f"{side}_hand", (0.005, -sign * 0.015, -0.03))
        stage.add("SPHERE", (0.01,), hand)
        readings.append(of_bone(stage.read(), f"{side}_hand"))
    left, right = readings
    assert (left > 0).sum() > 5
    np.testing.assert_allclose(left, right[:, [0, 2, 1, 5, 4, 3]], atol=1e-6)


def test_readings_are_invariant_to_rigid_motion_of_the_scene():
    rng = np.random.default_rng(0)
    still = Stage()
    ball = press_forearm(still, 0.003)
    before = still.read()
    turn, shift = random_turn(rng), rng.normal(size=3)
    moved = Stage(SPREAD, position=shift, rotation=turn)
    moved.add("SPHERE", (0.04,), turn @ ball.positions[0] + shift, turn)
    assert before.any()
    np.testing.assert_allclose(moved.read(), before, atol=1e-9)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_readings_equal_those_of_a_reference_without_culling(seed):
    """Random poses over the whole joint ranges; all shapes, self-contact and another body."""
    rng = np.random.default_rng(seed)
    stage = Stage(random_angles(rng), rotation=random_turn(rng))
    other = add_body(stage.scene, "other")
    pose(other, random_angles(rng), rng.normal(size=3) * 0.1, random_turn(rng))
    sizes = {"SPHERE": (0.06,), "BOX": (0.05, 0.07, 0.04), "CYLINDER": (0.05, 0.1)}
    sizes["CAPSULE"] = (0.04, 0.1)
    for shape, size in sizes.items():
        for _ in range(3):
            bone = rng.integers(47)
            place = stage.body.positions[bone] + rng.normal(size=3) * 0.04
            stage.add(shape, size, place, random_turn(rng))
    readings = stage.read()
    assert (readings > 0).sum() > 200
    np.testing.assert_allclose(readings, dense(stage), atol=1e-9)


def test_two_skins_in_contact_act_as_springs_in_series():
    """Forearms crossed front to front at half of the sum of both thicknesses: each reads 0.5."""
    stage = Stage()
    other = add_body(stage.scene, "other")
    bone = load_skeleton().bones[stage.bone("l_forearm")]
    thick, radius = bone.skin_thickness_m, bone.colliders[0].radius
    apart = 2.0 * radius + thick  # of 2 radii + 2 skins
    half_turn = np.diag((-1.0, 1.0, -1.0))  # the arms hang at nearly 45 degrees
    pose(other, SPREAD, rotation=half_turn)
    index, middle = stage.bone("l_forearm"), np.array([0.0, 0.0, -0.0475])
    there = other.positions[index] + other.rotations[index] @ middle
    here = stage.at("l_forearm", middle + np.array([apart, 0.0, 0.0]))
    pose(other, SPREAD, here - there, half_turn)
    assert of_bone(stage.read(), "l_forearm").max() == pytest.approx(0.5, abs=0.05)


def test_self_contact_is_sensed_except_at_joints():
    skeleton = load_skeleton()
    stage = Stage(np.zeros(82))
    before = stage.read()
    angles = np.zeros(82)
    angles[skeleton.joint("l_upper_arm", "abduction")] = -0.04
    pose(stage.body, angles)
    pressed = stage.read()
    assert of_bone(pressed, "l_forearm").sum() > of_bone(before, "l_forearm").sum()
    together = unsensed_bones(skeleton)
    thigh, pelvis, shank = (skeleton.bone(b) for b in ("l_thigh", "pelvis", "l_shank"))
    assert together[thigh, pelvis]
    assert together[thigh, shank]
    assert not together[thigh, skeleton.bone("r_thigh")]
    assert not together[thigh, skeleton.bone("l_hand")]
    np.testing.assert_array_equal(together, together.T)


def test_colliding_thighs_are_sensed_alike_on_both_sides():
    skeleton = load_skeleton()
    angles = SPREAD.copy()
    for side in "lr":
        angles[skeleton.joint(f"{side}_thigh", "abduction")] = -0.09
    readings = Stage(angles).read()
    left, right = of_bone(readings, "l_thigh"), of_bone(readings, "r_thigh")
    assert left.max() > 0.2
    np.testing.assert_allclose(left, right[:, [0, 2, 1, 5, 4, 3]], atol=1e-6)
    apart = [skeleton.bone(f"{side}_upper_arm") for side in "lr"]
    assert not unsensed_bones(skeleton)[*apart]


def test_every_pair_of_bones_that_collides_is_sensed():
    skeleton = load_skeleton()
    unsensed = unsensed_bones(skeleton)
    pairs = itertools.combinations(enumerate(bone.name for bone in skeleton.bones), 2)
    collide = [(i, j) for (i, a), (j, b) in pairs if may_collide(a, b)]
    assert len(collide) > 400
    assert not any(unsensed[pair] for pair in collide)


def test_a_finger_in_thick_skin_reads_on_the_side_of_contact_only():
    """The sum of both skins is more than the whole thickness of the finger.

    The facets are 30 degrees off the contact, so that they read less than depth over thickness.
    """
    stage = Stage()
    bone = stage.bone("l_index_proximal")
    radius, turn = 0.0033 + 0.0015, stage.body.rotations[bone]
    for pressed_m, reading in ((0.004, 0.21), (0.006, 0.40)):
        palmar = (0.0, -(radius + 0.05 - pressed_m), -0.0085)
        thing = stage.add(
            "BOX", (0.05, 0.05, 0.05), stage.at("l_index_proximal", palmar), turn, 0.01
        )
        readings = of_bone(stage.read(), "l_index_proximal")
        _, normals = taxel_positions(
            load_taxels(), stage.scene.meshes.vertices[stage.body.vertices]
        )
        facing = of_bone(normals, "l_index_proximal") @ turn[:, 1]
        assert readings[facing < -0.8].max() == pytest.approx(reading, abs=0.06)
        assert not readings[facing > 0.5].any()
        thing.positions[0] += 5.0


def test_the_reading_depends_on_the_present_geometry_only():
    """Equal when read again after the primitive was moved away and back."""
    stage = Stage()
    ball = press_forearm(stage, 0.003)
    first = stage.read()
    place = ball.positions[0].copy()
    ball.positions[0] += (0.0, 0.0, 0.3)
    assert not stage.read().any()
    ball.positions[0] = place
    np.testing.assert_array_equal(stage.read(), first)


def test_no_triangle_that_another_skin_presses_deeply_is_left_out():
    """A bound of how far a triangle's columns and fields reach must contain both.

    With a spread of depths of 1 km no triangle is left out.
    """
    rng, taxels = np.random.default_rng(0), load_taxels()
    everywhere = np.stack([taxels.layers[:, 0], np.full(len(taxels.layers), 1e3)], axis=1)
    culled, all_read = [], []
    for _ in range(30):
        stage = Stage(random_angles(rng), cfg=TouchCfg(receptive_field=0.6))
        other = add_body(stage.scene, "other")
        pose(other, random_angles(rng), rng.normal(size=3) * 0.1, random_turn(rng))
        stage.scene.update()
        for table, readings in (
            (taxels, culled),
            (taxels._replace(layers=everywhere), all_read),
        ):
            readings.append(readings_of(stage, table, 0.6))
    assert np.count_nonzero(np.array(all_read)) > 10_000
    np.testing.assert_array_equal(np.array(culled), np.array(all_read))


def readings_of(stage, taxels, share):
    """Return the readings of a stage's body for a table of taxels."""
    geoms, body = stage.scene.geoms, stage.body
    vertices = stage.scene.meshes.vertices[body.vertices]
    bones = rigid_bones(geoms, body, 47)
    readings = np.zeros(taxels.depths.shape)
    workspace = empty_workspace(taxels, len(vertices), len(geoms.shapes))
    fields, ignored = fields_of(taxels, share, body), unsensed_primitives(geoms, body)
    read_taxels(taxels, fields, vertices, geoms, bones, ignored, workspace, readings)
    return readings

"""The size of a body: lengths, masses and torques against the tables, symmetry, skin."""

import numpy as np
import pytest
from refusals import naming
from skins import heights_above_the_felt_skin

from veca_marl.sim.body.anatomy import (
    REFERENCE,
    Underside,
    binding_pose,
    forward_kinematics,
    growth_at,
    growth_of_height,
    load_skeleton,
    load_skin,
)
from veca_marl.sim.body.anatomy.growth import (
    REFERENCE_HEIGHT_M,
    SNYDER_CM,
    SNYDER_MONTHS,
    WHO_HEAD_CM,
    WHO_HEIGHT_CM,
    WHO_MASS_KG,
    measure_cm,
)
from veca_marl.sim.body.sense_organs import EYES, MOUNTS_M, resting_mount
from veca_marl.sim.geometry import Pose, Shape, deform_meshes, empty_meshes, with_mesh
from veca_marl.sim.touch.taxels import distance_to_bone, load_taxels, taxel_positions

AGES = (1, 4, 8, 18, 36)
LENGTHS = {
    "rump_knee": "l_thigh",
    "shoulder_elbow": "l_upper_arm",
    "hand_length": "l_hand",
    "foot_length": "l_foot",
}


@pytest.fixture(params=AGES)
def age(request):
    return request.param


@pytest.fixture
def growth(age):
    return growth_at(age)


def standing(skeleton):
    """Positions and rotations of the bones of a standing body with its pelvis at the origin."""
    positions, rotations = np.zeros((47, 3)), np.tile(np.eye(3), (47, 1, 1))
    forward_kinematics(skeleton, np.zeros(82), positions, rotations)
    return positions, rotations


def vertices_of(growth):
    """Vertices of the skin of a standing body."""
    mesh = load_skin(growth)
    bound = with_mesh(empty_meshes(), mesh, 0)
    deform_meshes(bound, *standing(load_skeleton(growth)))
    return bound.vertices


def test_without_a_size_the_body_is_that_of_the_table():
    assert load_skeleton() is load_skeleton(REFERENCE)
    assert load_skin() is load_skin(REFERENCE)
    assert load_skeleton().mass_kg == pytest.approx(10.0)
    assert REFERENCE.size == REFERENCE.leg == REFERENCE.speed == REFERENCE.pitch == 1.0
    assert REFERENCE.sitting == 1.0


def height_m(skeleton):
    """From the skin of the soles to the end of the head bone of a standing body."""
    positions, rotations = standing(skeleton)
    head = skeleton.bone("head")
    soles = Underside(skeleton, ["l_foot", "r_foot"], skin=True)
    top = positions[head, 2] + skeleton.bones[head].tip[2]
    return top - soles.lowest_m(positions, rotations)


def test_the_height_is_the_median_of_the_age(age, growth):
    assert height_m(load_skeleton(growth)) == pytest.approx(WHO_HEIGHT_CM[age - 1] / 100.0)
    # the skin of the top of the head is near the end of the bone
    assert np.ptp(vertices_of(growth)[:, 2]) == pytest.approx(growth.height_m, abs=0.01)


def test_the_lengths_of_the_table_of_bones_are_those_of_its_growth():
    assert height_m(load_skeleton()) == pytest.approx(REFERENCE_HEIGHT_M)


def test_the_mass_is_the_median_of_the_age(age, growth):
    assert load_skeleton(growth).mass_kg == pytest.approx(WHO_MASS_KG[age - 1])


def test_the_head_grows_with_its_circumference(growth, age):
    ratio = WHO_HEAD_CM[age - 1] / np.interp(100.0 * REFERENCE_HEIGHT_M, WHO_HEIGHT_CM, WHO_HEAD_CM)
    assert growth.head_size == pytest.approx(ratio)
    head = MOUNTS_M["eye_left"], MOUNTS_M["eye_right"]
    own = [resting_mount(eye, Pose(np.zeros(3), np.eye(3)), growth.head_size) for eye in EYES]
    apart_m = np.linalg.norm(own[0].position - own[1].position)
    assert apart_m == pytest.approx(ratio * (head[0][1] - head[1][1]))


@pytest.mark.parametrize(("measure", "bone"), LENGTHS.items())
def test_limbs_grow_as_measured(growth, age, measure, bone):
    """Between two ages lengths of bones are in the ratio of the fitted measures."""
    index, whole = load_skeleton().bone(bone), load_skeleton(growth_at(18))
    ratio = measure_cm(measure, age) / measure_cm(measure, 18)
    axis = 0 if bone == "l_foot" else 2
    here, there = (body.bones[index].tip[axis] for body in (load_skeleton(growth), whole))
    assert here / there == pytest.approx(ratio)


@pytest.mark.parametrize("measure", SNYDER_CM)
def test_the_fit_of_a_measure_is_near_the_measured_means(measure):
    fitted = [measure_cm(measure, months) for months in SNYDER_MONTHS]
    np.testing.assert_allclose(fitted, SNYDER_CM[measure], rtol=0.08)


def test_inertia_is_in_proportion_to_mass_times_length_squared(growth):
    """Exactly for the head, which keeps its form; for others between length and girth."""
    here, table = load_skeleton(growth), load_skeleton()
    for bone, other in zip(here.bones, table.bones, strict=True):
        ratio = np.linalg.eigvalsh(bone.inertia().matrix) / np.linalg.eigvalsh(
            other.inertia().matrix
        )
        per_mass = ratio / (bone.mass_kg / other.mass_kg)
        scale = np.array(growth.of(bone.name))
        assert (per_mass > (scale.min() * 0.999) ** 2).all(), bone.name
        assert (per_mass < (scale.max() * 1.001) ** 2).all(), bone.name
        if bone.name == "head":
            np.testing.assert_allclose(per_mass, growth.head_size**2)


def test_segments_keep_nearly_the_density_of_the_table(growth):
    """One factor makes the whole body as heavy as the median; bodies keep about their density."""
    volumes = [growth.of(bone.name).volume * bone.mass_kg for bone in load_skeleton().bones]
    assert load_skeleton(growth).mass_kg / sum(volumes) == pytest.approx(1.0, abs=0.15)


def test_torques_are_in_proportion_to_the_volume_of_the_bone(growth):
    here, table = load_skeleton(growth), load_skeleton()
    for joint, other in zip(here.joints, table.joints, strict=True):
        volume = growth.of(joint.bone).volume
        assert joint.torque_nm == pytest.approx(other.torque_nm * volume)
        assert (joint.low_rad, joint.high_rad) == (other.low_rad, other.high_rad)


def test_left_and_right_are_mirror_images(growth):
    skeleton = load_skeleton(growth)
    for bone in skeleton.bones:
        if bone.name.startswith("l_"):
            other = skeleton.bones[skeleton.bone("r_" + bone.name[2:])]
            np.testing.assert_allclose(np.array(bone.origin) * (1, -1, 1), other.origin)
            assert bone.mass_kg == pytest.approx(other.mass_kg)
    vertices = vertices_of(growth)
    apart = np.linalg.norm(vertices[:, None] * (1, -1, 1) - vertices[None], axis=2).min(1)
    assert apart.max() < 1e-12


def test_all_organs_are_in_the_head_or_on_its_skin(growth):
    skeleton = load_skeleton(growth)
    head = skeleton.bones[skeleton.bone("head")]
    frame = Pose(np.zeros(3), np.eye(3))
    for name in MOUNTS_M:
        organ = resting_mount(name, frame, growth.head_size).position
        here = distance_to_bone(head, organ[None])[0]
        table = load_skeleton().bones[skeleton.bone("head")]
        there = distance_to_bone(table, np.array([MOUNTS_M[name]]))[0]
        assert here == pytest.approx(there * growth.head_size, abs=1e-9)


def test_the_skin_has_the_same_triangles_in_the_same_order(growth):
    mesh, table = load_skin(growth), load_skin()
    np.testing.assert_array_equal(mesh.triangles, table.triangles)
    np.testing.assert_array_equal(mesh.owners, table.owners)
    np.testing.assert_array_equal(mesh.frames, table.frames)
    np.testing.assert_array_equal(mesh.weights, table.weights)


def test_the_taxels_have_the_same_order_and_lie_on_the_skin(growth):
    taxels, table, skeleton = load_taxels(growth), load_taxels(), load_skeleton(growth)
    np.testing.assert_array_equal(taxels.first_triangle, table.first_triangle)
    np.testing.assert_array_equal(taxels.triangles, table.triangles)
    np.testing.assert_array_equal(taxels.patches, table.patches)
    positions, rotations = binding_pose(skeleton)
    bound = with_mesh(empty_meshes(), load_skin(growth), 0)
    deform_meshes(bound, positions, rotations)
    points, normals = taxel_positions(taxels, bound.vertices)
    points = points - taxels.depths[..., None] * normals[:, None]
    off = []
    for index, bone in enumerate(skeleton.bones):
        own = slice(taxels.first_triangle[index], taxels.first_triangle[index + 1])
        local = (points[own] - positions[index]) @ rotations[index]
        off.append((distance_to_bone(bone, local) - bone.skin_thickness_m).ravel())
    off = np.abs(np.concatenate(off))
    assert np.median(off) < 1e-5
    assert np.mean(off < 1e-4) > 0.55


def test_the_drawn_skin_follows_the_felt_skin(growth):
    """Length and girth grow by different factors: vertices keep their places, caps their forms."""
    _, heights = heights_above_the_felt_skin(growth)
    assert np.mean(np.abs(heights) < 0.002) > 0.96
    assert np.abs(heights).max() < 0.007


def test_no_face_of_the_skin_looks_inward(growth):
    mesh, vertices, skeleton = load_skin(growth), vertices_of(growth), load_skeleton(growth)
    positions, rotations = standing(skeleton)
    a, b, c = np.moveaxis(vertices[mesh.triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres, step = (a + b + c) / 3.0, 1e-5
    for index, bone in enumerate(skeleton.bones):
        own = mesh.owners == index
        at = (centres[own] - positions[index]) @ rotations[index]
        out = normals[own] @ rotations[index]
        rise = distance_to_bone(bone, at + step * out) - distance_to_bone(bone, at - step * out)
        assert (rise / (2 * step) > -0.3).all(), bone.name


def test_colliders_keep_their_shapes(growth):
    for bone, other in zip(load_skeleton(growth).bones, load_skeleton().bones, strict=True):
        assert [part.shape for part in bone.colliders] == [part.shape for part in other.colliders]
        assert all(part.shape in (Shape.BOX, Shape.CAPSULE) for part in bone.colliders)


def test_everything_grows_with_the_age():
    months = np.linspace(1.0, 36.0, 141)
    sizes = [growth_at(float(age)) for age in months]
    for length in ("size", "leg", "head_size", "sitting"):
        values = np.array([getattr(size, length) for size in sizes])
        assert (np.diff(values) > -1e-3).all(), length
    assert (np.diff([size.pitch for size in sizes]) <= 0.0).all()


def test_a_height_is_that_of_the_age_at_which_it_is_the_median():
    assert growth_of_height(WHO_HEIGHT_CM[7] / 100.0).mass_kg == pytest.approx(WHO_MASS_KG[7])
    own = growth_of_height(REFERENCE_HEIGHT_M)
    assert own.head_size == pytest.approx(1.0)
    assert own.leg == pytest.approx(1.0)
    assert own.height_m == pytest.approx(REFERENCE_HEIGHT_M)


@pytest.mark.parametrize("wrong", [0.9, 36.1, float("nan")])
def test_an_age_outside_the_tables_is_refused(wrong):
    with pytest.raises(ValueError, match=naming(f"body.age_months={wrong}", "1", "36")):
        growth_at(wrong)


@pytest.mark.parametrize("wrong", [0.5, 1.0])
def test_a_height_outside_the_tables_is_refused(wrong):
    with pytest.raises(ValueError, match=naming(f"body.height_m={wrong}", "0.5415", "0.9557")):
        growth_of_height(wrong)

"""The taxels: their number, their places, and sensing points on the physical skin."""

import csv
from importlib.resources import files

import numpy as np
import pytest
from skins import add_body
from touching import SPREAD

from veca_marl.sim.body.anatomy import binding_pose, load_skeleton
from veca_marl.sim.geometry import Scene
from veca_marl.sim.touch.taxels import (
    BARYCENTRIC,
    distance_to_bone,
    load_taxels,
    taxel_positions,
    taxels_of,
)


def bound_points():
    """Sensing points ``(T, 6, 3)`` and normals in the binding pose of the skin."""
    scene = Scene()
    body = add_body(scene)
    body.positions[:], body.rotations[:] = binding_pose(load_skeleton())
    scene.update()
    taxels = load_taxels()
    points, normals = taxel_positions(taxels, scene.meshes.vertices)
    return points - taxels.depths[..., None] * normals[:, None], normals


def test_the_9888_taxels_are_distributed_as_in_the_table_of_bones():
    with (files("veca_marl") / "data" / "bones.csv").open(encoding="utf-8") as table:
        wanted = {row["bone"]: int(row["taxels"]) for row in csv.DictReader(table)}
    slices = {bone.name: taxels_of(bone.name) for bone in load_skeleton().bones}
    assert {name: s.stop - s.start for name, s in slices.items()} == wanted
    assert sum(wanted.values()) == 9888 == load_taxels().depths.size
    ends = [0, *(s.stop for s in slices.values())]
    assert [s.start for s in slices.values()] == ends[:-1]


def test_the_error_of_an_unknown_bone_lists_the_bones():
    with pytest.raises(KeyError, match=r"left_hand.*l_hand"):
        taxels_of("left_hand")


def test_six_taxels_form_a_triangle_within_each_triangle():
    np.testing.assert_allclose(BARYCENTRIC.sum(1), 1.0)
    assert BARYCENTRIC.min() > 0.1
    np.testing.assert_allclose(BARYCENTRIC.mean(0), 1 / 3)
    assert len(np.unique(BARYCENTRIC.round(9), axis=0)) == 6


def test_most_sensing_points_lie_on_the_physical_skin():
    """Within a tenth of a millimetre; the others lie over gaps between bones or at rims."""
    taxels, skeleton = load_taxels(), load_skeleton()
    points, _ = bound_points()
    positions, rotations = binding_pose(skeleton)
    off = []
    for index, bone in enumerate(skeleton.bones):
        own = slice(taxels.first_triangle[index], taxels.first_triangle[index + 1])
        local = (points[own] - positions[index]) @ rotations[index]
        off.append((distance_to_bone(bone, local) - bone.skin_thickness_m).ravel())
    off = np.abs(np.concatenate(off))
    assert np.median(off) < 1e-5
    assert np.mean(off < 1e-4) > 0.6


def test_patches_contain_their_triangles_and_bones_their_patches():
    taxels = load_taxels()
    assert np.all(np.diff(taxels.patches) > 0)
    np.testing.assert_array_equal(taxels.patches[taxels.first_patch], taxels.first_triangle)
    for patch in range(len(taxels.patches) - 1):
        triangles = taxels.triangles[taxels.patches[patch] : taxels.patches[patch + 1]]
        vertices = taxels.vertices[taxels.first_vertex[patch] : taxels.first_vertex[patch + 1]]
        assert set(triangles.ravel()) == set(vertices)


def test_the_arms_of_the_spread_pose_are_within_their_limits():
    joints = load_skeleton().joints
    assert all(j.low_rad <= a <= j.high_rad for j, a in zip(joints, SPREAD, strict=True))

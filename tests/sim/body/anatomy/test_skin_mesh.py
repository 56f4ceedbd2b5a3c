"""The skin as a mesh: counts, closedness, orientation, symmetry, felt skin."""

import csv
from collections import Counter
from importlib.resources import files

import numpy as np
import pytest
from skins import add_body, heights_above_the_felt_skin

from veca_marl.sim.body.anatomy import binding_pose, load_skeleton, load_skin
from veca_marl.sim.geometry import Scene
from veca_marl.sim.touch.taxels import distance_to_bone


def bound_vertices():
    """Vertices in the pose the skin is bound in."""
    mesh, (positions, rotations) = load_skin(), binding_pose(load_skeleton())
    first = mesh.frames[:, 0]
    return positions[first] + np.einsum("vij,vj->vi", rotations[first], mesh.offsets[:, 0])


def normals_and_areas(vertices, triangles):
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    doubled = np.linalg.norm(normals, axis=1)
    return normals / doubled[:, None], doubled / 2


def edges(triangles):
    return Counter((t[i], t[(i + 1) % 3]) for t in triangles.tolist() for i in range(3))


def test_there_are_1648_triangles_and_894_vertices_that_follow_two_bones_at_most():
    mesh = load_skin()
    assert mesh.triangles.shape == (1648, 3)
    assert mesh.frames.shape == (894, 2)
    assert set(mesh.triangles.ravel().tolist()) == set(range(894))
    np.testing.assert_allclose(mesh.weights.sum(1), 1.0)
    assert mesh.weights.min() >= 0.0


def test_each_bone_has_the_triangles_of_the_table():
    with (files("veca_marl") / "data" / "bones.csv").open(encoding="utf-8") as table:
        wanted = [int(row["triangles"]) for row in csv.DictReader(table)]
    owners = load_skin().owners
    assert np.bincount(owners, minlength=47).tolist() == wanted
    assert np.all(np.diff(owners) >= 0)


def test_both_bones_of_a_vertex_agree_where_it_is_bound():
    mesh, (positions, rotations) = load_skin(), binding_pose(load_skeleton())
    placed = positions[mesh.frames] + np.einsum(
        "vkij,vkj->vki", rotations[mesh.frames], mesh.offsets
    )
    np.testing.assert_allclose(placed[:, 0], placed[:, 1], atol=1e-12)


def test_a_vertex_follows_neighbouring_bones_only():
    mesh, bones = load_skin(), load_skeleton().bones
    for one, other in np.unique(mesh.frames, axis=0):
        assert one == other or bones[one].parent == other or bones[other].parent == one


def test_the_surface_is_closed_but_for_rims_in_or_right_above_other_parts():
    mesh, vertices, skeleton = load_skin(), bound_vertices(), load_skeleton()
    all_edges = edges(mesh.triangles)
    assert max(all_edges.values()) == 1
    rim = {a for a, b in all_edges if (b, a) not in all_edges}
    assert sum((b, a) not in all_edges for a, b in all_edges) == 100
    positions, rotations = binding_pose(skeleton)
    hosts = {"thigh": "pelvis", "shank": "foot"}
    for vertex in rim:
        bone = skeleton.bones[mesh.frames[vertex, 0]]
        side, part = bone.name[:2], bone.name[2:]
        host = hosts.get(part, "hand")
        index = skeleton.bone(host if host == "pelvis" else side + host)
        point = (vertices[vertex] - positions[index]) @ rotations[index]
        host_skin = skeleton.bones[index].skin_thickness_m
        assert distance_to_bone(skeleton.bones[index], point) < host_skin + 0.022, bone.name


def test_no_face_looks_inward():
    mesh, vertices, skeleton = load_skin(), bound_vertices(), load_skeleton()
    normals, _ = normals_and_areas(vertices, mesh.triangles)
    centres = vertices[mesh.triangles].mean(1)
    positions, rotations = binding_pose(skeleton)
    for index, bone in enumerate(skeleton.bones):
        own = mesh.owners == index
        at = (centres[own] - positions[index]) @ rotations[index]
        out = normals[own] @ rotations[index]
        step = 1e-5
        rise = distance_to_bone(bone, at + step * out) - distance_to_bone(bone, at - step * out)
        assert (rise / (2 * step) > -0.2).all(), bone.name


def test_the_drawn_skin_and_the_felt_skin_agree_within_2_mm():
    owners, heights = heights_above_the_felt_skin()
    bones = load_skeleton().bones
    for index, bone in enumerate(bones):
        own = owners == index
        assert own.sum() >= 60, bone.name  # taxels that are not inside another limb
        assert np.abs(heights[own]).max() < 0.002, bone.name


def test_the_body_is_as_large_as_the_table_says():
    scene = Scene()
    add_body(scene)
    scene.update()
    vertices = scene.meshes.vertices
    _, areas = normals_and_areas(vertices, scene.meshes.triangles)
    assert np.ptp(vertices[:, 2]) == pytest.approx(0.78, abs=0.01)
    assert 0.45 < areas.sum() < 0.52


def test_right_is_the_mirror_image_of_left():
    mesh, vertices = load_skin(), bound_vertices()
    mirrored = vertices * (1.0, -1.0, 1.0)
    apart = np.linalg.norm(mirrored[:, None] - vertices[None], axis=2).min(1)
    assert apart.max() < 1e-12
    names = [bone.name for bone in load_skeleton().bones]
    for bone, name in enumerate(names):
        if name.startswith("l_"):
            left = mesh.triangles[mesh.owners == bone]
            right = mesh.triangles[mesh.owners == names.index("r_" + name[2:])]
            np.testing.assert_allclose(
                vertices[left], vertices[right[:, [0, 2, 1]]] * (1, -1, 1), atol=1e-12
            )

"""Linear blend skinning against its formula, and rigid motions."""

import dataclasses

import numpy as np
import pytest
from refusals import naming
from skins import add_body, pose, random_angles, random_turn

from veca_marl.sim.body.anatomy import load_skin
from veca_marl.sim.geometry import Scene


def skinned(angles, position=(0.0, 0.0, 0.0), rotation=None):
    scene = Scene()
    item = add_body(scene)
    pose(item, angles, position, rotation)
    scene.update()
    return item, scene.meshes


def test_vertices_are_the_weighted_mean_of_their_places_on_the_bones():
    rng = np.random.default_rng(0)
    mesh = load_skin()
    for _ in range(5):
        item, meshes = skinned(random_angles(rng))
        placed = item.positions[mesh.frames] + np.einsum(
            "vkij,vkj->vki", item.rotations[mesh.frames], mesh.offsets
        )
        wanted = (mesh.weights[..., None] * placed).sum(1)
        np.testing.assert_allclose(meshes.vertices, wanted, atol=1e-14)


def test_a_rigid_motion_of_the_bones_moves_the_skin_rigidly():
    rng = np.random.default_rng(1)
    angles, turn, shift = random_angles(rng), random_turn(rng), rng.normal(size=3)
    _, still = skinned(angles)
    _, moved = skinned(angles, shift, turn)
    np.testing.assert_allclose(moved.vertices, still.vertices @ turn.T + shift, atol=1e-12)
    np.testing.assert_allclose(moved.normals, still.normals @ turn.T, atol=1e-9)


def test_normals_are_unit_vectors_that_point_outward():
    _, meshes = skinned(np.zeros(82))
    np.testing.assert_allclose(np.linalg.norm(meshes.normals, axis=1), 1.0)
    grown = meshes.vertices + 1e-4 * meshes.normals
    assert volume(grown, meshes.triangles) > volume(meshes.vertices, meshes.triangles)


def volume(vertices, triangles):
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.einsum("ti,ti->", a, np.cross(b, c)) / 6


def test_meshes_of_two_bodies_are_independent():
    rng = np.random.default_rng(2)
    scene = Scene()
    one, two = add_body(scene, "one"), add_body(scene, "two")
    angles = random_angles(rng)
    pose(one, angles)
    pose(two, angles, (1.0, 2.0, 3.0))
    scene.update()
    vertices = scene.meshes.vertices
    np.testing.assert_allclose(vertices[two.vertices], vertices[one.vertices] + (1, 2, 3))
    assert scene.meshes.triangles[two.triangles].min() == two.vertices.start


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("weights", np.ones((894, 2))),
        ("offsets", np.zeros((894, 3))),
        ("triangles", np.full((1648, 3), 894)),
        ("colours", np.zeros((5, 3), np.float32)),
    ],
)
def test_inconsistent_meshes_are_refused(field, wrong):
    with pytest.raises(ValueError, match=naming("mesh", field)):
        dataclasses.replace(load_skin(), **{field: wrong})

"""Hidden meshes are skipped, and the image is bit-identical."""

import numpy as np
import pytest
from eye_scenes import clutter, random_pose, random_rotations
from skins import add_body, pose, random_angles, random_turn

from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.vision import Camera, look_at
from veca_marl.sim.vision.camera import view_axes
from veca_marl.sim.vision.mesh_rasterizer import draw_meshes
from veca_marl.sim.vision.rasterizer import draw_geoms

CAMERA = Camera(48, 40, 60.0)
BODIES = 5


def cluttered_scene(rng):
    scene = clutter(rng, per_shape=2)
    for n in range(BODIES):
        body = add_body(scene, f"body {n}")
        pose(
            body, random_angles(rng, 0.3), rng.uniform((-2, -2, 0.2), (2, 2, 0.8)), random_turn(rng)
        )
    scene.update()
    return scene


def buffers(scene, eye, culled):
    """Depths and surfaces of one view, and which vertices were transformed."""
    view, geoms, meshes = view_axes(eye), scene.geoms, scene.meshes
    size = (CAMERA.height, CAMERA.width)
    depth, surfaces = np.full(size, CAMERA.far_m, np.float32), np.full(size, -1, np.int16)
    seen = np.full_like(meshes.vertices, np.nan)
    draw_geoms(geoms, geoms.visible, view, CAMERA.lens, True, depth, surfaces)
    drawn = np.ones(len(meshes.triangles), np.bool_)
    first = len(geoms.shapes)
    draw_meshes(meshes, drawn, view, CAMERA.lens, culled, first, seen, depth, surfaces)
    carried = np.isfinite(seen[meshes.first_vertices[:-1], 0])
    return depth, surfaces, carried


def test_bounding_boxes_are_tight():
    scene = cluttered_scene(np.random.default_rng(0))
    for body, lower, upper in zip(
        scene.objects[-BODIES:], scene.meshes.lower, scene.meshes.upper, strict=True
    ):
        vertices = scene.meshes.vertices[body.vertices]
        np.testing.assert_array_equal(lower, vertices.min(axis=0))
        np.testing.assert_array_equal(upper, vertices.max(axis=0))


@pytest.mark.slow
def test_culling_does_not_change_a_bit_of_the_image():
    """Random cameras, also inside the bounding boxes and between the limbs."""
    rng, left_out, shown = np.random.default_rng(1), 0, 0
    for _ in range(12):
        scene = cluttered_scene(rng)
        eyes = [random_pose(rng) for _ in range(10)]
        for body in scene.objects[-BODIES:]:
            near = body.positions[rng.integers(len(body.positions))] + rng.normal(0.0, 0.05, 3)
            eyes.append(eyes[0]._replace(position=near, rotation=random_rotations(1, rng)[0]))
        for eye in eyes:
            depth, surfaces, carried = buffers(scene, eye, culled=True)
            true_depth, true_surfaces, all_carried = buffers(scene, eye, culled=False)
            np.testing.assert_array_equal(depth, true_depth)
            np.testing.assert_array_equal(surfaces, true_surfaces)
            assert all_carried.all()
            left_out += (~carried).sum()
            shown += (surfaces >= len(scene.geoms.shapes)).any()
    assert left_out > 0.4 * 12 * 15 * BODIES
    assert shown > 30


@pytest.mark.parametrize(
    ("wall_x", "yaw", "left_out"), [(1.0, 0.0, True), (3.0, 0.0, False), (3.0, np.pi, True)]
)
def test_meshes_behind_walls_or_the_camera_are_skipped(wall_x, yaw, left_out):
    scene = Scene()
    scene.add_object("wall", [[Geom(Shape.BOX, (0.05, 3.0, 3.0), offset=(wall_x, 0.0, 0.0))]])
    pose(add_body(scene), np.zeros(82), np.array([2.0, 0.0, 0.0]))
    scene.update()
    eye = look_at(np.zeros(3), np.array([np.cos(yaw), np.sin(yaw), 0.0]))
    _, _, carried = buffers(scene, eye, culled=True)
    assert carried.tolist() == [not left_out]

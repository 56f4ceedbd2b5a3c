"""The rasterizer of primitives compared with ray casting and TinyRenderer."""

import math

import numpy as np
import pytest
from eye_scenes import SIMPLE, cast, clutter, random_pose, random_rotations, small_camera

from tools.fidelity.vision import TinyRenderer
from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera, look_at
from veca_marl.sim.vision.camera import view_axes
from veca_marl.sim.vision.rasterizer import draw_geoms


def draw(scene, camera, pose, bounded):
    depth = np.full((camera.height, camera.width), camera.lens.far, np.float32)
    surfaces = np.full(depth.shape, -1, np.int16)
    drawn = np.ones(len(scene.geoms.shapes), np.bool_)
    draw_geoms(scene.geoms, drawn, view_axes(pose), camera.lens, bounded, depth, surfaces)
    return depth, surfaces


@pytest.mark.parametrize("fov_deg", [40.0, 90.0, 140.0])
def test_bounding_rectangles_lose_no_pixel(fov_deg):
    rng = np.random.default_rng(0)
    camera = small_camera(fov_deg=fov_deg)
    for _ in range(8):
        scene = clutter(rng)
        for _ in range(12):
            pose = random_pose(rng)
            bounded, full = (draw(scene, camera, pose, way) for way in (True, False))
            np.testing.assert_array_equal(bounded[1], full[1])
            np.testing.assert_array_equal(bounded[0], full[0])


@pytest.mark.parametrize("shape", [Shape.CYLINDER, Shape.CAPSULE])
def test_bounding_rectangles_contain_rods_beside_the_camera(shape):
    rng = np.random.default_rng(7)
    camera = small_camera()
    for _ in range(60):
        scene = Scene()
        rods = scene.add_object("rods", [[Geom(shape, (0.05, 4.0))]] * 8)
        rods.positions[:] = rng.uniform(-1, 1, (8, 3))
        rods.rotations[:] = random_rotations(8, rng)
        scene.update()
        pose = random_pose(rng)
        bounded, full = (draw(scene, camera, pose, way) for way in (True, False))
        np.testing.assert_array_equal(bounded[1], full[1])


@pytest.mark.parametrize("shape", SIMPLE)
def test_agrees_with_ray_casting_in_double_precision(shape):
    rng = np.random.default_rng(int(shape))
    camera = small_camera()
    differing, total = 0, 0
    for _ in range(20):
        scene, pose = clutter(rng, shapes=(shape,)), random_pose(rng)
        views = camera.render(scene, [pose])
        depth, ids = cast(scene, camera, pose)
        same = views.ids[0] == ids
        differing, total = differing + np.sum(~same), total + same.size
        np.testing.assert_allclose(views.depth[0][same], depth[same], rtol=2e-3, atol=1e-4)
    assert differing <= 2e-4 * total  # rounding at silhouettes


def test_thin_primitives_are_complete_at_a_distance():
    """A capsule of 5 mm radius at 20 m covers its analytic area in a narrow field of view."""
    scene = Scene()
    finger = scene.add_object("finger", [[Geom(Shape.CAPSULE, (0.005, 0.04))]])
    finger.positions[0] = (20.0, 0.0, 0.0)
    scene.update()
    camera = Camera(400, 400, fov_deg=0.2, far_m=50.0)
    ids = camera.render(scene, [Pose(np.zeros(3), np.eye(3))]).ids[0]
    metres_per_pixel = 2 * math.tan(math.radians(0.1)) * 20.0 / 400
    area = 0.01 * 0.04 + math.pi * 0.005**2
    assert (ids == 0).sum() * metres_per_pixel**2 == pytest.approx(area, rel=0.02)


def test_rays_parallel_to_faces_and_axes():
    """Such rays cause divisions by zero."""
    camera = Camera(63, 63)
    sizes = [(0.2,), (0.2, 0.3, 0.4), (0.2, 0.5), (0.2, 0.5)]
    for shape, size in zip(list(Shape)[:4], sizes, strict=True):
        scene = Scene()
        scene.add_object("thing", [[Geom(shape, size)]])
        scene.update()
        for eye in np.concatenate((np.eye(3), -np.eye(3))):
            forward = -eye
            left = np.roll(np.abs(eye), 1)
            pose = Pose(2.0 * eye, np.stack([forward, left, np.cross(forward, left)], 1))
            views = camera.render(scene, [pose])
            depth, ids = cast(scene, camera, pose)
            assert (views.ids[0] == ids).mean() > 0.999
            assert views.ids[0, 31, 31] == 0
            assert views.depth[0, 31, 31] == pytest.approx(depth[31, 31], abs=1e-5)


def test_the_same_pose_gives_the_same_bytes():
    rng = np.random.default_rng(1)
    scene, pose = clutter(rng), random_pose(rng)
    first, second = (Camera().render(scene, [pose]) for _ in range(2))
    for one, two in zip(first, second, strict=True):
        assert one.tobytes() == two.tobytes()


WALL = 1
"""Row of the wall; that of the floor is 0, those of other primitives are more."""


@pytest.mark.parametrize(
    ("shape", "missing"),
    # its boxes are exact; the others are polyhedra within the shape, those of capsules the coarsest
    [(Shape.BOX, 5e-4), (Shape.SPHERE, 0.1), (Shape.CYLINDER, 0.035), (Shape.CAPSULE, 0.35)],
)
def test_agrees_with_tiny_renderer(shape, missing):
    """Of the pixels of all primitives that fraction differs, whatever their size in the picture."""
    rng = np.random.default_rng(2)
    scene = clutter(rng, shapes=(shape,))
    camera = Camera(84, 84, 60.0, near_m=0.02, far_m=12.0)
    shown = differing = outside = 0
    with TinyRenderer(scene) as tiny:
        for _ in range(30):
            eye = rng.uniform((-2.8, -2.8, 0.8), (-2.2, 2.8, 1.8))
            pose = look_at(eye, rng.uniform((-0.5, -0.5, 0.2), (0.5, 0.5, 0.6)))
            _, surfaces = draw(scene, camera, pose, bounded=True)
            theirs = tiny.segment(camera, pose)
            shown += ((surfaces > WALL) | (theirs > WALL)).sum()
            differing += (surfaces != theirs).sum()
            outside += ((surfaces <= WALL) & (theirs > WALL)).sum()
    assert differing <= missing * shown
    assert outside <= 0.005 * shown  # rounding at silhouettes


def test_pixel_centres_are_symmetric_about_the_optical_axis():
    """A box on the axis is symmetric in the image; TinyRenderer samples at pixel corners."""
    scene = Scene()
    scene.add_object("box", [[Geom(Shape.BOX, (0.3, 0.31, 0.31), offset=(2, 0, 0))]])
    scene.update()
    camera, pose = Camera(84, 84, 60.0), Pose(np.zeros(3), np.eye(3))
    _, surfaces = draw(scene, camera, pose, bounded=True)
    assert 0 < (surfaces == 0).sum() < surfaces.size
    np.testing.assert_array_equal(surfaces, surfaces[:, ::-1])
    np.testing.assert_array_equal(surfaces, surfaces[::-1])

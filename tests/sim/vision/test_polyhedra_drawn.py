"""Pictures of polyhedra: against ray casting, of boxes made of faces, with light and segments."""

import numpy as np
import pytest
from eye_scenes import random_pose, random_rotations, small_camera

from veca_marl.sim.geometry import Geom, Scene, Shape, convex_hull, sector_of_disc
from veca_marl.sim.geometry.polyhedra import face_rows, polyhedron_entry, sizes_of
from veca_marl.sim.vision import look_at


def scene_of(hull, pose, **look):
    scene = Scene()
    scene.add_object("floor", [[Geom(Shape.BOX, (3, 3, 0.1), offset=(0, 0, -0.1))]])
    item = scene.add_object("thing", [[Geom(Shape.POLYHEDRON, (), hull=hull, **look)]])
    item.positions[0], item.rotations[0] = pose
    scene.update()
    return scene, item


def test_every_pixel_agrees_with_a_ray_in_double_precision():
    rng, camera = np.random.default_rng(0), small_camera(width=31, height=23)
    x = (2 * (np.arange(31) + 0.5) / 31 - 1) * camera.lens.tan_x
    y = (1 - 2 * (np.arange(23) + 0.5) / 23) * camera.lens.tan_y
    differing = shown = 0
    for number in range(12):
        hull = convex_hull(rng.uniform(-0.4, 0.4, (9, 3)))
        where, turn = rng.uniform((-1, -1, 0.5), (1, 1, 1.2)), random_rotations(1, rng)[0]
        scene, item = scene_of(hull, (where, turn))
        middle = where + turn @ hull.centroid
        ahead = look_at(middle + rng.uniform((-1, -1, 0.3), (1, 1, 1)), middle)
        pose = ahead if number % 2 else random_pose(rng)
        seen = camera.render(scene, [pose]).ids[0] == item.id
        assert seen[11, 15] or pose is not ahead
        faces, size = face_rows(hull), sizes_of(hull, 0)
        for j, i in np.ndindex(23, 31):
            ray = pose.rotation @ np.array([1.0, -x[i], y[j]])
            ray /= np.linalg.norm(ray)
            point = turn.T @ (pose.position - where)
            hit = polyhedron_entry(faces, size, tuple(point), tuple(turn.T @ ray)) < 1e8
            floor = pose.position[2] + 1e8 * ray[2] > 0.0
            differing += int(seen[j, i] != hit) if floor else int(seen[j, i] and not hit)
        shown += seen.sum()
    assert shown > 100
    assert differing <= 5


@pytest.mark.parametrize("transparent", [False, True])
def test_a_box_of_faces_looks_like_a_box(transparent):
    """Shape, depth, brightness, pattern, contact shadow and transparency agree."""
    half, rng, camera = np.array([0.3, 0.2, 0.25]), np.random.default_rng(1), small_camera()
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * half
    look = {"checker_m": 0.1, "transparent": transparent, "colour": (0.9, 0.4, 0.2)}
    pose = np.array([0.2, -0.1, 0.25]), np.eye(3)
    of_faces, _ = scene_of(convex_hull(corners), pose, **look)
    scene = Scene()
    scene.add_object("floor", [[Geom(Shape.BOX, (3, 3, 0.1), offset=(0, 0, -0.1))]])
    box = scene.add_object("thing", [[Geom(Shape.BOX, tuple(half), **look)]])
    box.positions[0] = pose[0]
    scene.update()
    for _ in range(4):
        eye = look_at(rng.uniform((-2, -2, 0.6), (2, 2, 1.5)), pose[0])
        one, other = camera.render(of_faces, [eye]), camera.render(scene, [eye])
        different = np.abs(one.rgb.astype(int) - other.rgb).max(axis=-1) > 2
        assert different.mean() < 0.004
        assert np.mean(one.ids != other.ids) < 0.004
        np.testing.assert_array_equal(one.glass_ids.shape, other.glass_ids.shape)


def test_faces_that_face_the_light_are_brighter():
    scene, _ = scene_of(sector_of_disc(0.5, 0.4, 90.0), (np.array([0, 0, 0.5]), np.eye(3)))
    camera = small_camera()
    top = camera.render(scene, [look_at(np.array([0.25, 0.01, 2.0]), np.array([0.25, 0, 0.5]))])
    side = camera.render(scene, [look_at(np.array([-1.0, -0.8, 0.5]), np.array([0.1, 0, 0.5]))])
    brightness = [views.rgb[views.ids == 1].mean() for views in (top, side)]
    assert brightness[0] > 1.3 * brightness[1]

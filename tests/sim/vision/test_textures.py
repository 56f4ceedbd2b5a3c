"""Checker patterns are fixed to objects."""

import numpy as np
import pytest
from eye_scenes import random_rotations

from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera, look_at

CAMERA = Camera(120, 120, 40.0)
SIZES = {
    Shape.SPHERE: (0.4,),
    Shape.BOX: (0.3, 0.25, 0.2),
    Shape.CYLINDER: (0.3, 0.5),
    Shape.CAPSULE: (0.25, 0.4),
}


def picture(shape, pose, camera_pose, checker_m=0.11):
    """The image of one primitive off its object's origin, the object at a pose."""
    geom = Geom(
        shape, SIZES[shape], colour=(1, 1, 1), offset=(0.05, -0.03, 0.02), checker_m=checker_m
    )
    scene = Scene()
    item = scene.add_object("thing", [[geom]])
    item.positions[0], item.rotations[0] = pose
    scene.update()
    return CAMERA.render(scene, [camera_pose]).rgb[0].astype(int)


def dark_tiles(shape, pose, camera_pose):
    """Mask of the pixels that show dark tiles."""
    plain = picture(shape, pose, camera_pose, checker_m=0.0)
    return (picture(shape, pose, camera_pose) < plain).any(axis=-1)


EYE = look_at(np.array([1.6, 0.5, 0.9]), np.zeros(3))
HERE = Pose(np.zeros(3), np.eye(3))


@pytest.mark.parametrize("shape", SIZES)
def test_a_moved_and_turned_object_has_the_same_texture_from_the_moved_and_turned_camera(shape):
    rng = np.random.default_rng(int(shape))
    original = dark_tiles(shape, HERE, EYE)
    assert 0.05 < original.mean() < 0.5
    for turn in random_rotations(4, rng):
        way = rng.uniform(-3.0, 3.0, 3)
        camera = Pose(turn @ EYE.position + way, turn @ EYE.rotation)
        moved = dark_tiles(shape, Pose(way, turn), camera)
        # single precision of depths may move an edge of a tile by a pixel here and there
        assert np.mean(moved != original) < 0.002


@pytest.mark.parametrize("shape", [Shape.SPHERE, Shape.CYLINDER])
def test_a_thing_that_turns_in_place_changes_its_picture(shape):
    """Its outline and its light stay; only the pattern moves."""
    angle = 0.3
    c, s = np.cos(angle), np.sin(angle)
    turned = Pose(np.zeros(3), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    before, after = (dark_tiles(shape, pose, EYE) for pose in (HERE, turned))
    assert np.mean(before != after) > 0.03


def test_a_thing_that_slides_keeps_its_texture():
    """Seen from a camera that moves along, the whole picture stays, light included."""
    way = np.array([0.037, -0.021, 0.0])
    moved = Pose(EYE.position + way, EYE.rotation)
    before, after = picture(Shape.BOX, HERE, EYE), picture(Shape.BOX, Pose(way, np.eye(3)), moved)
    assert np.mean((before != after).any(axis=-1)) < 0.002

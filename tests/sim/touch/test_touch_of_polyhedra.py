"""Touch of polyhedra: the laws of approaches, and a pyramid that presses on a forearm."""

import numpy as np
import pytest
from touching import Stage, of_bone

from tools.fidelity.touch.flat_skin import Approach, extremes
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import Geom, Shape, convex_hull, pyramid


def test_readings_rise_until_the_bone_is_reached():
    """The laws of `tools.fidelity`, for pyramids with their tips and edges ahead."""
    rng = np.random.default_rng(0)
    approaches = [
        Approach(Shape.POLYHEDRON, width, skin, path, tilt, float(rng.uniform(0, 360)), radius)
        for width in (0.005, 0.02)
        for skin in (0.0015, 0.004, 0.01)
        for path in (0.0, 30.0, 60.0)
        for tilt in (0.0, 40.0, 180.0)
        for radius in (0.5, 1.0, 2.0)
    ]
    found = extremes(approaches, 60)
    assert found.largest_fall < 1e-4
    assert found.least_at_bone > 0.999


def pressed_by(geom, depth_m):
    """The readings of a forearm with the lowest side (-x) of a primitive pressed into its front."""
    stage = Stage()
    bone = load_skeleton().bones[stage.bone("l_forearm")]
    front = bone.colliders[0].radius + bone.skin_thickness_m
    thing = stage.scene.add_object("thing", [[geom]])
    index = stage.bone("l_forearm")
    thing.positions[0] = stage.at("l_forearm", (front - depth_m, 0.0, -0.0475))
    thing.rotations[0] = stage.body.rotations[index]
    return of_bone(stage.read(), "l_forearm")


def test_a_box_of_faces_feels_like_a_box():
    half = np.array([0.02, 0.03, 0.015])
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * half
    box = Geom(Shape.BOX, tuple(half), offset=(0.02, 0.0, 0.0))
    faces = Geom(Shape.POLYHEDRON, (), offset=(0.02, 0.0, 0.0), hull=convex_hull(corners))
    expected = pressed_by(box, 0.002)
    assert expected.max() > 0.3
    # sizes of boxes are stored in single precision
    np.testing.assert_allclose(pressed_by(faces, 0.002), expected, atol=1e-5)


@pytest.mark.parametrize("depth_m", [0.001, 0.003])
def test_the_tip_of_a_pyramid_is_felt_by_fewer_taxels_than_its_base(depth_m):
    tip_first = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # z to -x
    shape = pyramid(0.03, 0.03, 0.03)
    tip = Geom(Shape.POLYHEDRON, (), (0.015, 0, 0), tip_first, hull=shape)
    base = Geom(Shape.POLYHEDRON, (), (0.015, 0, 0), tip_first @ np.diag([1, -1, -1]), hull=shape)
    by_tip, by_base = pressed_by(tip, depth_m), pressed_by(base, depth_m)
    assert 0.0 < by_tip.max() <= 1.0
    assert 0 < (by_tip > 0.05).sum() < 0.6 * (by_base > 0.05).sum()
    assert by_base.max() >= by_tip.max()

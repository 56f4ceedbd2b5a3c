"""The laws of touch, for a part of the cases of the page, and their symmetries."""

from dataclasses import replace

import numpy as np
import pytest

from tools.fidelity.touch.bare_body import noticed_pokes
from tools.fidelity.touch.flat_skin import (
    Approach,
    FlatSkin,
    Thing,
    all_approaches,
    extremes,
    rotation,
)
from tools.fidelity.touch.laws import RADII, plane_error
from veca_marl.sim.geometry import Shape
from veca_marl.sim.touch import TouchCfg

PLANE = Thing(Shape.BOX, (1.0, 1.0, 1.0), np.eye(3))


def test_readings_never_fall_on_the_way_to_the_bone_and_are_one_there():
    """Shapes from 3 mm on, several skins, paths and tilts; the readings fell to 0 at the bone."""
    approaches = list(all_approaches(np.random.default_rng(0), RADII))[::23]
    found = extremes(approaches, 60)
    assert found.count > 150
    assert found.largest_fall < 1e-4
    assert found.least_at_bone > 0.999


@pytest.mark.parametrize("radius", [0.0, *RADII])
def test_under_a_parallel_plane_the_reading_is_depth_over_thickness(radius):
    assert plane_error(radius) < 1e-4


@pytest.mark.parametrize("degrees", [10.0, 30.0, 60.0])
def test_without_a_field_a_tilted_plane_reads_depth_times_cosine(degrees):
    """The paper's formula."""
    turn = rotation(1, degrees)
    plane = FlatSkin(0.01, 0.0, replace(PLANE, rotation=turn))
    for depth_m in (0.001, 0.002, 0.004):
        reading = plane.read((1.0 - depth_m) * turn[:, 2])
        assert reading == pytest.approx(depth_m / 0.01 * np.cos(np.deg2rad(degrees)), abs=1e-4)


@pytest.mark.parametrize("shape", [Shape.SPHERE, Shape.BOX, Shape.CYLINDER, Shape.CAPSULE])
def test_a_world_of_another_scale_reads_the_same(shape):
    small = Approach(shape, 0.005, 0.004, path_deg=30.0, tilt_deg=40.0, turn_deg=25.0)
    large = replace(small, width_m=0.02, skin_m=0.016)
    shares = np.linspace(1.5, 0.0, 20)
    readings = []
    for approach in (small, large):
        thing = approach.thing()
        skin = FlatSkin(approach.skin_m, approach.skin_m, thing)
        path = rotation(1, 150.0)[:, 2]
        end = np.array([0.0, 0.0, -approach.skin_m]) - thing.foremost(path)
        readings.append([skin.read(end - share * approach.skin_m * path) for share in shares])
    assert max(readings[0]) > 0.9
    np.testing.assert_allclose(*readings, atol=1e-4)


def test_two_skins_in_contact_read_the_same_share():
    """Whichever of the two is thicker; bone meets bone at 1."""
    for own, other in ((0.01, 0.0015), (0.0015, 0.01), (0.004, 0.004)):
        skin = FlatSkin(own, own, replace(PLANE, skin_m=other))
        for share in (0.0, 0.2, 0.5, 0.9, 1.0, 1.2):
            reading = skin.read(np.array([0.0, 0.0, 1.0 - share * (own + other)]))
            assert reading == pytest.approx(min(share, 1.0), abs=1e-4)


@pytest.mark.parametrize("bone", ["chest", "head"])
def test_a_fingertip_is_noticed_almost_anywhere_at_a_quarter_of_the_skin(bone):
    """At points, without receptive fields, it is noticed in a third of the places."""
    rng = np.random.default_rng(0)
    assert noticed_pokes(bone, 0.25, 60, TouchCfg().receptive_field, rng).share >= 0.9
    assert noticed_pokes(bone, 0.25, 60, 0.0, rng).share < 0.6

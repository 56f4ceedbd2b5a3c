"""Primitives follow their frames, and objects can be added at any time."""

import numpy as np
import pytest
from eye_scenes import random_rotations
from refusals import naming

from veca_marl.sim.geometry import Geom, Scene, Shape

BALL = Geom(Shape.SPHERE, (0.1,))


def test_primitives_follow_their_frames():
    rng = np.random.default_rng(0)
    turn, frame_turn = random_rotations(2, rng)
    scene = Scene()
    scene.add_object("other", [[BALL]])
    item = scene.add_object(
        "arm", [[], [BALL, Geom(Shape.CAPSULE, (0.1, 0.3), offset=(1, 2, 3), rotation=turn)]]
    )
    item.positions[1] = (4, 5, 6)
    item.rotations[1] = frame_turn
    scene.update()
    rows = item.geoms
    np.testing.assert_allclose(scene.geoms.positions[rows][0], (4, 5, 6))
    np.testing.assert_allclose(scene.geoms.positions[rows][1], (4, 5, 6) + frame_turn @ (1, 2, 3))
    np.testing.assert_allclose(scene.geoms.rotations[rows][1], frame_turn @ turn)
    np.testing.assert_array_equal(scene.geoms.objects, [0, 1, 1])


def test_an_object_may_be_added_after_an_update():
    scene = Scene()
    early = scene.add_object("early", [[BALL]])
    early.positions[0] = (1, 0, 0)
    scene.update()
    late = scene.add_object("late", [[BALL], [BALL]])
    np.testing.assert_array_equal(early.positions, [(1, 0, 0)])
    early.positions[0] = (2, 0, 0)
    late.positions[:] = [(3, 0, 0), (4, 0, 0)]
    scene.update()
    np.testing.assert_array_equal(scene.geoms.positions[:, 0], [2, 3, 4])
    assert (early.id, late.id) == (0, 1)


def test_a_late_object_is_drawn_at_the_origin_until_the_update():
    scene = Scene()
    scene.add_object("late", [[Geom(Shape.SPHERE, (0.1,), offset=(0, 0, 1))]])
    np.testing.assert_array_equal(scene.geoms.positions, [(0, 0, 1)])


def test_hidden_marks_the_primitives_of_some_frames():
    scene = Scene()
    scene.add_object("before", [[BALL]])
    body = scene.add_object("body", [[BALL], [BALL, BALL], [BALL]])
    np.testing.assert_array_equal(scene.hidden(body.id, (1, 2)), [False, False, True, True, True])
    assert not scene.hidden(body.id, ()).any()


def test_the_error_for_an_unknown_object_lists_the_objects():
    scene = Scene()
    ball = scene.add_object("ball", [[BALL]])
    assert scene.find("ball") is ball
    with pytest.raises(KeyError, match=r"'bell'.*\['ball'\]"):
        scene.find("bell")


def test_painting_changes_one_object():
    scene = Scene()
    scene.add_object("grey", [[BALL]])
    ball = scene.add_object("ball", [[BALL, BALL]])
    before = scene.version
    ball.paint((1.0, 0.0, 0.0))
    np.testing.assert_allclose(scene.geoms.colours, [BALL.colour, (1, 0, 0), (1, 0, 0)])
    assert scene.version > before
    with pytest.raises(ValueError, match="colour"):
        ball.paint((1.0, 0.0, 2.0))


def test_painting_changes_the_triangles_of_one_object(make_child):
    world, child = make_child()
    colours = world.scene.surfaces.colours
    before = colours.copy()
    world.scene.find(child.name).paint((0.0, 1.0, 0.0))
    painted = (colours == np.float32([0.0, 1.0, 0.0])).all(axis=1)
    np.testing.assert_array_equal(painted, world.scene.surfaces.objects == child.object_id)
    np.testing.assert_array_equal(colours[~painted], before[~painted])


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ({"size": (0.1, 0.2)}, "radius"),
        ({"size": (-0.1,)}, "-0.1"),
        ({"size": (np.nan,)}, "nan"),
        ({"shape": Shape.BOX}, "half x, half y, half z"),
        ({"colour": (0.0, 1.5, 0.0)}, "1.5"),
        ({"offset": (0.0, np.inf, 0.0)}, "inf"),
        ({"rotation": 2 * np.eye(3)}, "rotation"),
        ({"rotation": np.diag((1.0, 1.0, -1.0))}, "rotation"),
        ({"checker_m": -1.0}, "-1.0"),
    ],
)
def test_impossible_primitives_are_refused(numbers, named):
    with pytest.raises(ValueError, match=named):
        Geom(**({"shape": Shape.SPHERE, "size": (0.1,)} | numbers))


def test_impossible_objects_are_refused():
    scene = Scene()
    scene.add_object("ball", [[BALL]])
    with pytest.raises(ValueError, match=naming("'ball'")):
        scene.add_object("ball", [[BALL]])
    with pytest.raises(ValueError, match=naming("'ghost'", "frame")):
        scene.add_object("ghost", [])
    with pytest.raises(ValueError, match=r"object id 7"):
        scene.hidden(7, ())
    with pytest.raises(ValueError, match=r"frames \(3,\)"):
        scene.hidden(0, (3,))


def test_a_scene_can_be_full():
    with pytest.raises(ValueError, match=naming("'dust'", "40000", "32767")):
        Scene().add_object("dust", [[BALL] * 40_000])

"""The values of a start: what belongs to them, and in what two starts differ."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.benchmark import NEXT_NUMBER, differences, start_state, start_values
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game


@pytest.fixture
def game():
    game = Game(compose(["+task=KickTheBall", "senses/vision=blind"]).game)
    game.reset(Episodes(0).next())
    yield game
    game.close()


def test_the_state_has_the_poses_of_bones_and_props(game):
    state = start_state(game)
    assert len(state) == 12 * (47 * len(game.players) + len(game.world.props))
    np.testing.assert_allclose(state[:3], game.players[0].body.bone_positions()[0], atol=1e-6)


def test_the_values_are_those_of_bodies_and_props(game):
    start, body, ball = (
        start_values(game, Episodes(0).next()),
        game.players[0].body,
        game.world.prop("ball"),
    )
    np.testing.assert_allclose(start["agents/position"], body.position, atol=1e-6)
    np.testing.assert_allclose(start["agents/joints"], body.joint_angles(), atol=1e-6)
    np.testing.assert_allclose(start["ball/position"], ball.position, atol=1e-6)
    np.testing.assert_allclose(start["ball/velocity"], ball.velocity, atol=1e-6)
    assert np.linalg.norm(start["ball/velocity"]) >= 0.5
    yaw = 2.0 * np.arctan2(*start["agents/quaternion"][2:])
    assert np.cos(yaw) == pytest.approx(body.forward[0], abs=1e-5)
    assert start["agents/muted"] == (0.0,)


def changes_of(game, change):
    """Return the names of the values that a change of the world changes."""
    before = start_values(game, Episodes(0).next())
    change()
    return [text.split()[0] for text in differences(start_values(game, Episodes(0).next()), before)]


def test_each_change_is_noticed_in_its_value(game):
    body, ball = game.players[0].body, game.world.prop("ball")
    x, y, _ = body.position
    shown = game.world.scene.objects[ball.object_id]
    assert changes_of(game, lambda: None) == []
    assert changes_of(game, lambda: body.place((x + 0.01, y, 0.0), body.yaw_rad)) == [
        "agents/position"
    ]
    assert changes_of(game, lambda: body.place((x + 0.01, y, 0.0), 1.0)) == ["agents/quaternion"]
    assert changes_of(game, lambda: setattr(body, "muted", True)) == ["agents/muted"]
    assert changes_of(game, lambda: ball.set_velocity((0.0, 0.0, 0.1))) == ["ball/velocity"]
    assert changes_of(game, lambda: shown.paint((0.1, 0.2, 0.3))) == ["ball/colour"]


def test_doors_have_an_opening():
    game = Game(compose(["+task=BabyzumasRevenge"]).game)
    game.reset(Episodes(0).next())
    drawer = game.world.prop("cupboard.drawer")
    assert start_values(game, Episodes(0).next())["cupboard.drawer/opening"] == (0.0,)
    assert changes_of(game, lambda: drawer.set_opening(0.5)) == [
        "cupboard.drawer/position",
        "cupboard.drawer/opening",
    ]
    game.close()


def test_a_draw_that_sets_nothing_is_noticed_and_the_generator_is_left_alone(game):
    rng = Episodes(5).next()
    first = start_values(game, rng)
    assert start_values(game, rng) == first
    rng.random()
    assert [text.split()[0] for text in differences(start_values(game, rng), first)] == [
        NEXT_NUMBER
    ]


def test_differences_are_named_with_both_values():
    stored = {"a/position": (0.0, 1.0), "b/quaternion": (0.0, 0.0, 0.6, 0.8), "c/muted": (0.0,)}
    found = {"a/position": (0.0, 1.1), "b/quaternion": (0.0, 0.0, -0.6, -0.8), "d/muted": (1.0,)}
    assert differences(found, stored) == [
        "c/muted is missing",
        "d/muted is new",
        "a/position is 0, 1.1 (not 0, 1)",
    ]
    assert differences({"a": (1.0,)}, {"a": (1.0, 2.0)}) == ["a is 1 (not 1, 2)"]
    joints = tuple(map(float, range(82)))
    (joint,) = differences({"a/joints": (*joints[:-1], -81.0)}, {"a/joints": joints})
    assert all(part in joint for part in ("a/joints", "1 of 82", "81", "-81"))
    assert len(joint) < 80
    (shorter,) = differences({"a/joints": joints[:-1]}, {"a/joints": joints})
    assert all(part in shorter for part in ("81 numbers", "82 numbers"))
    assert len(shorter) < 120


def test_the_rounding_of_processors_is_no_difference():
    assert differences({"a": (1.000005,)}, {"a": (1.0,)}) == []
    assert len(differences({"a": (1.00002,)}, {"a": (1.0,)})) == 1

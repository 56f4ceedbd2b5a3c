"""Helper reward, free places and visibility in navigation tasks."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from seeking import BALL_M, ball_at, walker_at, wall_across, world_with

from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.navigation import helper_reward
from veca_marl.envs.tasks.navigation.helper_reward import PropVisibility, displacement_to
from veca_marl.envs.tasks.navigation.places import free_pair, free_place, gap_m
from veca_marl.sim.physics import RoomCfg
from veca_marl.sim.vision import Camera, look_at, seen_fraction

STEP_S = 0.04
AHEAD = np.array([5.0, 0.0, 0.0])
LEFT, RIGHT = np.array([5.0, 1.0, 0.0]), np.array([5.0, -1.0, 0.0])


def mover(velocity, yaw_deg=0.0):
    yaw = math.radians(yaw_deg)
    forward = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    return SimpleNamespace(
        forward=forward, velocity=np.array([*velocity, 0.0]), position=np.zeros(3)
    )


@pytest.mark.parametrize(
    ("velocity", "target", "way"),
    [
        ((1.0, 0.0), AHEAD, (0.04, 0.0)),
        ((-1.0, 0.0), AHEAD, (-0.04, 0.0)),
        ((0.0, 1.0), LEFT, (0.0, 0.04)),
        ((0.0, 1.0), RIGHT, (0.0, -0.04)),
        ((0.0, -1.0), RIGHT, (0.0, 0.04)),
        ((0.0, -1.0), LEFT, (0.0, -0.04)),
        ((0.5, -2.0), RIGHT, (0.02, 0.08)),
    ],
)
def test_displacements_have_components_ahead_and_to_the_side(velocity, target, way):
    np.testing.assert_allclose(displacement_to(mover(velocity), target, STEP_S), way, atol=1e-15)


def test_displacements_are_relative_to_the_heading():
    """After a quarter turn to the left, the front is on the right."""
    np.testing.assert_allclose(
        displacement_to(mover((1.0, 0.0), yaw_deg=90.0), AHEAD, STEP_S), (0.0, 0.04), atol=1e-15
    )


def test_the_gap_is_the_horizontal_distance_to_the_surface():
    world = world_with(ball_at(3.0, 4.0))
    thing = world.props["ball"]
    assert gap_m(np.array([0.0, 0.0, 7.0]), thing) == pytest.approx(5.0 - BALL_M)
    assert gap_m(np.array([0.0, 0.0]), thing) == pytest.approx(5.0 - BALL_M)
    world.close()


def test_free_places_are_clear_of_props_and_walls():
    world = world_with(ball_at(0.5, 0.5))
    thing, room = world.props["ball"], RoomCfg(lower_m=(0.0, 0.0, 0.0), size_m=(2.0, 2.0, 2.0))
    rng = np.random.default_rng(0)
    places = np.array([free_place(room, [thing], 0.3, rng) for _ in range(300)])
    gaps = [gap_m(place, thing) for place in places]
    assert 0.3 <= min(gaps) < 0.34
    np.testing.assert_allclose(places.min(axis=0)[:2], 0.3, atol=0.05)
    np.testing.assert_allclose(places.max(axis=0)[:2], 1.7, atol=0.05)
    with pytest.raises(ValueError, match=r"leaves no floor 0\.95 m away from everything"):
        free_place(room, [thing], 0.95, rng)
    world.close()


def test_pairs_of_places_are_clear_and_apart_in_a_small_room():
    """On 1.4 x 1.4 m of floor hardly any place is 1 m away from the middle."""
    world = world_with(ball_at(0.2, 0.2))
    thing, room = world.props["ball"], RoomCfg(lower_m=(0.0, 0.0, 0.0), size_m=(3.0, 3.0, 2.0))
    rng = np.random.default_rng(0)
    pairs = [free_pair(room, [thing], 0.8, 1.0, rng) for _ in range(300)]
    apart = [math.dist(*pair) for pair in pairs]
    assert 1.0 <= min(apart) < 1.05
    for place in np.concatenate(pairs):
        assert gap_m(place, thing) >= 0.8
        assert room.contains(place + np.array([0.0, 0.0, 1.0]), 0.8)
    with pytest.raises(ValueError, match=r"leaves no two places 2\.0 m apart and 0\.8 m away"):
        free_pair(room, [thing], 0.8, 2.0, rng)
    world.close()


@pytest.fixture
def world():
    """A wall between the origin and a ball; the player `near` is on the ball's side."""
    made = world_with(ball_at(3.0, 0.0), wall_across(1.5))
    yield made
    made.close()


def test_walls_hide_the_object(world):
    behind = Player("behind", "team", walker_at(world, name="behind"))
    near = Player("near", "team", walker_at(world, 2.0, name="near"))
    world.refresh()
    sight = PropVisibility(world.scene, world.props["ball"])
    assert [sight.for_player(player) for player in (behind, near, behind)] == [False, True, False]


def test_visibility_is_computed_once_per_version_of_the_scene(world, monkeypatch):
    asked = []

    def look(scene, body, thing):
        asked.append(thing)
        return True

    monkeypatch.setattr(helper_reward, "is_visible", look)
    sight, player = PropVisibility(world.scene, world.props["ball"]), Player("one", "team", None)
    assert sight.for_player(player)
    assert sight.for_player(player)
    assert len(asked) == 1
    world.step()
    assert sight.for_player(player)
    assert len(asked) == 2
    sight.clear()
    assert sight.for_player(player)
    assert len(asked) == 3


def test_an_eye_in_contact_with_a_wall_does_not_see_through_it():
    """Eyes of crawling bodies come within 11 mm of walls."""
    world = world_with(wall_across(2.0), ball_at(6.0, 0.0))
    world.freeze()
    world.refresh()
    for away_m in (0.004, 0.011, 0.05):
        for aside_rad in (0.0, 0.6, 1.1):
            eye = look_at(
                np.array([1.95 - away_m, 0.0, 0.3]),
                np.array([1.95 + math.cos(aside_rad), math.sin(aside_rad), 0.3]),
            )
            views = Camera().render(world.scene, [eye])
            assert seen_fraction(views, world.prop("ball").object_id) == 0.0
            if aside_rad == 0.0:
                wall = world.prop("wall").object_id
                assert seen_fraction(views, wall) == 1.0
    world.close()

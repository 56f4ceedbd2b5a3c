"""Helper reward, free places and visibility in navigation tasks."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from seeking import BALL_M, ball_at, walker_at, wall_across, world_with

from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.navigation.helper_reward import PropVisibility, displacement_to
from veca_marl.envs.tasks.navigation.places import free_pair, free_place, gap_m
from veca_marl.sim.physics import RoomCfg
from veca_marl.sim.vision import Camera, VisionCfg, VisionSense, look_at, seen_fraction

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


def player_of(world, **vision):
    """A player 2 m before the ball that faces past it, with a sense of vision or without any."""
    body = walker_at(world, 2.0, name="one")
    if not vision:
        return Player("one", "team", body)
    sense = VisionSense(VisionCfg(**vision), body, world)
    return Player("one", "team", body, {"vision": sense})


def test_visibility_is_that_of_the_players_own_images(world):
    """Its field of view, its resolution and its open eyes."""
    player = player_of(world, fov_deg=120.0, width=40, height=40)
    sight = PropVisibility(world.scene, world.props["ball"])
    away = world.props["ball"].position - player.body.position
    ahead = math.atan2(away[1], away[0])
    for aside_deg, visible in ((0.0, True), (48.0, True), (80.0, False)):
        player.body.place(player.body.position, ahead + math.radians(aside_deg))
        world.refresh()
        assert sight.for_player(player) is visible, aside_deg
        default = sight.for_player(Player("other", "team", player.body))
        assert default is (aside_deg == 0.0)


def test_visibility_of_what_is_observed_renders_nothing(world, monkeypatch):
    rendered, render = [], Camera.render
    monkeypatch.setattr(Camera, "render", lambda *args: rendered.append(args) or render(*args))
    player = player_of(world, width=30)
    sight = PropVisibility(world.scene, world.props["ball"])
    for _ in range(3):
        world.step()
        before = len(rendered)
        seen = sight.for_player(player)
        player.senses["vision"].read()
        assert sight.for_player(player) is seen
        assert len(rendered) == before + 1


def test_visibility_without_a_sense_is_rendered_once_per_step(world, monkeypatch):
    rendered, render = [], Camera.render
    monkeypatch.setattr(Camera, "render", lambda *args: rendered.append(args) or render(*args))
    sight, player = PropVisibility(world.scene, world.props["ball"]), player_of(world)
    for steps in (1, 2):
        world.step()
        assert sight.for_player(player) is sight.for_player(player)
        assert len(rendered) == steps
    assert rendered[0][0] == Camera()


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

"""Helper reward, free places and visibility in navigation tasks."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import naming
from seeking import BALL_M, ball_at, walker_at, wall_across, world_with

from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.floors.places import free_pair, free_place, gap_m
from veca_marl.envs.tasks.navigation.helper_reward import HelperReward, PropVisibility
from veca_marl.sim.physics import RoomCfg
from veca_marl.sim.vision import Camera, VisionCfg, VisionSense, look_at, seen_fraction

AHEAD = np.array([5.0, 0.0, 0.0])
BEHIND = -AHEAD
LEFT, RIGHT = np.array([5.0, 1.0, 0.0]), np.array([5.0, -1.0, 0.0])


class Sees(HelperReward):
    """The prop is visible unless it is behind the player."""

    def sees(self, prop, player):
        return bool((prop.position - player.body.position) @ player.body.forward > 0.0)


def helped(target, *poses):
    """Return the terms of a player at a prop in each step, from poses (x, y, yaw in degrees)."""
    player = SimpleNamespace(name="one", body=SimpleNamespace())
    helper, terms = Sees(scene=None), []
    for x, y, yaw_deg in poses:
        yaw = math.radians(yaw_deg)
        player.body.position = np.array([x, y, 0.0])
        player.body.forward = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        if not terms:
            helper.reset(SimpleNamespace(position=np.array(target)), [player])
        helper.after_step([player])
        terms.append(helper.terms(player))
    return [(step["ahead"], math.degrees(step["turn"])) for step in terms[1:]]


@pytest.mark.parametrize(
    ("target", "pose", "terms"),
    [
        (AHEAD, (0.04, 0.0, 0.0), (0.04, 0.0)),
        (AHEAD, (-0.04, 0.0, 0.0), (-0.04, 0.0)),
        (AHEAD, (0.0, 0.04, 0.0), (0.0, -math.degrees(math.atan2(0.04, 5.0)))),
        (LEFT, (0.0, 0.0, 5.0), (0.0, 5.0)),
        (LEFT, (0.0, 0.0, -5.0), (0.0, -5.0)),
        (RIGHT, (0.0, 0.0, -5.0), (0.0, 5.0)),
        (BEHIND, (-0.04, 0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_motion_and_turns_towards_a_visible_prop_are_rewarded(target, pose, terms):
    assert helped(target, (0.0, 0.0, 0.0), pose) == [pytest.approx(terms, abs=1e-9)]


def test_a_turn_past_the_prop_and_back_adds_up_to_nothing():
    terms = helped(LEFT, *[(0.0, 0.0, yaw_deg) for yaw_deg in (0.0, 8.0, 16.0, 24.0, 10.0, 0.0)])
    assert sum(turn for _, turn in terms) == pytest.approx(0.0, abs=1e-9)
    assert terms[0][1] == pytest.approx(8.0)


def test_a_prop_that_comes_into_view_is_not_a_turn():
    entered = helped(LEFT, (0.0, 0.0, 150.0), (0.0, 0.0, 60.0), (0.0, 0.0, 50.0))
    assert [turn for _, turn in entered] == pytest.approx([0.0, 10.0])


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
    with pytest.raises(ValueError, match=naming("2 x 2 m", "0.95 m")):
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
    with pytest.raises(ValueError, match=naming("3 x 3 m", " 2 m ", "0.8 m")):
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
    sight = PropVisibility(world.scene)
    assert [sight.of(world.props["ball"], player) for player in (behind, near, behind)] == [
        False,
        True,
        False,
    ]


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
    sight = PropVisibility(world.scene)
    away = world.props["ball"].position - player.body.position
    ahead = math.atan2(away[1], away[0])
    for aside_deg, visible in ((0.0, True), (48.0, True), (80.0, False)):
        player.body.place(player.body.position, ahead + math.radians(aside_deg))
        world.refresh()
        assert sight.of(world.props["ball"], player) is visible, aside_deg
        default = sight.of(world.props["ball"], Player("other", "team", player.body))
        assert default is (aside_deg == 0.0)


def test_visibility_of_what_is_observed_renders_nothing(world, monkeypatch):
    rendered, render = [], Camera.render
    monkeypatch.setattr(Camera, "render", lambda *args: rendered.append(args) or render(*args))
    player = player_of(world, width=30)
    sight = PropVisibility(world.scene)
    for _ in range(3):
        world.step()
        before = len(rendered)
        seen = sight.of(world.props["ball"], player)
        player.senses["vision"].read()
        assert sight.of(world.props["ball"], player) is seen
        assert len(rendered) == before + 1


def test_visibility_without_a_sense_is_rendered_once_per_step(world, monkeypatch):
    rendered, render = [], Camera.render
    monkeypatch.setattr(Camera, "render", lambda *args: rendered.append(args) or render(*args))
    sight, player = PropVisibility(world.scene), player_of(world)
    for steps in (1, 2):
        world.step()
        assert sight.of(world.props["ball"], player) is sight.of(world.props["ball"], player)
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

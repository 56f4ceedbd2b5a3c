"""MultiAgentNav: the weights, and the helper reward while an agent sees the object."""

import math

import numpy as np
import pytest
from seekers import STEP_S, begin, game_of, put, step

from veca_marl.envs.tasks.navigation.helper_reward import HelperReward
from veca_marl.envs.tasks.navigation.multi_agent_nav import MultiAgentNavCfg


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def test_the_weights_are_those_of_the_paper():
    assert MultiAgentNavCfg().weights == {"reached": 1.0, "ahead": 0.05, "turn": 0.03}


def moved(game, yaw_deg, *commands):
    """Move 1.5 m east of the object; return the helper terms ``(steps, 2)``."""
    begin(game)
    put(game, 0, 1.5, yaw_deg=yaw_deg)
    step(game)
    name, other = [player.name for player in game.players]
    found = []
    for command in commands:
        terms = step(game, **{name: command}).terms
        found.append([terms[name]["ahead"], terms[name]["turn"]])
        assert (terms[other]["ahead"], terms[other]["turn"]) == (0.0, 0.0)
    return np.array(found)


def walked(game, yaw_deg, forward=1.0):
    return tuple(moved(game, yaw_deg, (forward, 0.0))[0])


@pytest.mark.parametrize("forward", [0.0, 1.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_turning_towards_a_visible_object_is_rewarded(game, side, forward):
    """The object is 20 degrees to the left (side=1) or right."""
    towards = moved(game, 180.0 - 20.0 * side, (forward, side))[0, 1]
    away = moved(game, 180.0 - 20.0 * side, (forward, -side))[0, 1]
    assert towards > 0.03
    assert away < -0.03


def test_turning_to_and_fro_in_front_of_the_object_adds_nothing(game):
    turns = moved(game, 170.0, *[(0.0, side) for side in (1.0, 1.0, -1.0, -1.0) * 4])[:, 1]
    assert np.abs(turns).sum() > 0.3
    assert abs(turns.sum()) < 1e-3


def test_turning_round_adds_at_most_one_step_of_turning(game):
    """The object leaves the images on one side and enters them on the other."""
    turned_rad = abs(moved(game, 170.0, (0.0, 1.0))[0, 1])
    steps = round(2.0 * math.pi / turned_rad)
    turns = moved(game, 180.0, *[(0.0, 1.0)] * steps)[:, 1]
    assert np.abs(turns).sum() > 0.5
    assert abs(turns.sum()) <= 1.01 * turned_rad


def test_going_to_and_fro_in_front_of_the_object_is_no_substitute_for_reaching_it(game):
    """Only the way there is rewarded: on the way back the object is not visible."""
    half_turn = [(0.0, 1.0)] * round(math.pi / abs(moved(game, 170.0, (0.0, 1.0))[0, 1]))
    lap = [*[(1.0, 0.0)] * 12, *half_turn, *[(1.0, 0.0)] * 12, *half_turn]
    steps = round(game.task.cfg.max_seconds / STEP_S)
    terms = moved(game, 180.0, *(lap * steps)[:steps]).sum(axis=0)
    weights = game.task.cfg.weights
    total = weights["ahead"] * terms[0] + weights["turn"] * terms[1]
    assert 0.02 < total < 0.4 * weights["reached"]


def test_turning_quickly_out_of_sight_and_slowly_back_adds_nothing(game):
    """The object leaves the images in one step, and enters them in many."""
    there_and_back = [(0.0, 1.0), *[(0.0, -0.25)] * 4]
    start = moved(game, 180.0, *[(0.0, 1.0)] * 7)
    turns = moved(game, 180.0, *[(0.0, 1.0)] * 7, *there_and_back * 30)[:, 1]
    assert (turns == 0.0).any(), "the test must see the object out of sight"
    assert turns[7:].sum() < 0.05
    assert turns.sum() < start[:, 1].sum() + 0.05


@pytest.mark.parametrize("rate_hz", [5, 10, 25])
def test_the_first_step_of_an_episode_counts_at_every_control_rate(rate_hz):
    """A turn of 24 degrees towards an object that is visible at the start."""
    game = game_of(f"clock.control_rate_hz={rate_hz}", f"clock.substeps={50 // rate_hz * 5}")
    begin(game)
    put(game, 0, 1.5, yaw_deg=156.0)
    player, helper, turned_rad = game.players[0], HelperReward(game.world.scene), 0.0
    helper.reset(game.task.target, [player])
    for _ in range(rate_hz // 5):
        helper.before_step([player])
        step(game, **{player.name: (0.0, 1.0)})
        helper.after_step([player])
        turned_rad += helper.terms(player)["turn"]
    assert turned_rad == pytest.approx(math.radians(24.0), abs=0.03)
    game.close()


def test_the_helper_reward_is_in_metres_while_the_object_is_visible(game):
    np.testing.assert_allclose(walked(game, 180.0), (STEP_S, 0.0), atol=1e-4)
    assert walked(game, 165.0)[0] == pytest.approx(STEP_S, abs=1e-4)
    assert walked(game, 180.0, forward=-1.0)[0] == pytest.approx(-0.3 * STEP_S, rel=0.01)


def test_the_helper_reward_is_0_while_the_object_is_not_visible(game):
    assert walked(game, 0.0) == (0.0, 0.0)
    begin(game)
    put(game, 0, 2.5, -1.0, yaw_deg=160.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == 0.0


@pytest.mark.parametrize("vision", ["binocular", "blind"])
def test_players_see_the_target_with_their_own_eyes(vision):
    """The target is 15 degrees to the side, outside of the images of a narrow preset."""
    game = game_of(f"senses/vision={vision}", "senses.vision.fov_deg=6")
    begin(game)
    put(game, 0, 1.5, yaw_deg=165.0)
    finder = game.players[0]
    step(game, **{finder.name: (0.0, 0.0)})
    assert ("vision" in game.observe(finder)) == (vision == "binocular")
    assert game.task.sees_target(finder) is (vision == "blind")
    game.close()


def test_the_object_is_visible_through_a_door(game):
    begin(game)
    game.task.target.place((0.5, 0.9, 0.2))
    put(game, 0, 3.0, 0.9, yaw_deg=180.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == pytest.approx(STEP_S, rel=0.01)


def test_the_helper_reward_is_0_after_the_arrival(game):
    begin(game)
    put(game, 0, 0.62, yaw_deg=180.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == 0.0
    assert game.task.arrived == {name}

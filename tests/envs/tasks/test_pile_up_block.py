"""PileUpBlock: reward, success criterion, start and expert."""

from contextlib import contextmanager

import numpy as np
import pytest
from blocks import blocks_game, play, sit, sits

from veca_marl.envs.experts.control.carrying import lift
from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion
from veca_marl.envs.tasks.objects.toys_and_blocks import (
    height_in_edges,
    is_at_rest,
    is_released,
    rests_on,
)
from veca_marl.sim.physics.bullet_client import pybullet

EDGE = 0.06
# at which the expert succeeds; its share of successes is that of the frozen episodes
EXPERT_SEEDS = (2, 3, 4, 5)
AWAY = (1.0, 1.0, EDGE / 2)


@pytest.fixture(scope="module")
def game():
    game = blocks_game("PileUpBlock")
    yield game
    game.close()


def starts(game, count):
    for seed in range(count):
        game.reset(np.random.default_rng(seed))
        yield [block.position for block in game.task.red]


def test_blocks_start_apart_in_front_of_the_body(game):
    places = np.array(list(starts(game, 30)))
    np.testing.assert_allclose(places[:, :, 2], EDGE / 2, atol=1e-9)
    assert (np.abs(places[:, 0] - places[:, 1]).max(axis=1) > 2 * EDGE).all()
    assert places[:, 0, 1].min() >= 0.07
    assert places[:, 1, 1].max() <= -0.07
    assert np.ptp(places[:, 0], axis=0)[:2].min() > 0.02


def test_a_blue_block_starts_behind_the_red_ones(game):
    for places in starts(game, 10):
        blue = game.task.blue.position
        assert blue[2] == pytest.approx(EDGE / 2)
        assert blue[0] - max(place[0] for place in places) >= EDGE


def test_the_start_is_at_rest(game):
    for before in starts(game, 3):
        terms = list(sit(game, 0.2))  # then a child that bears no weight leans over
        assert sits(game)
        assert np.abs(game.players[0].body.velocities()).max() < 1.0
        for block, place in zip(game.task.red, before, strict=True):
            assert np.linalg.norm(block.position - place) < 0.003
        assert max(abs(step["height"]) for step in terms) < 0.1
        assert max(abs(step["lift"]) for step in terms) < 0.1


def test_a_block_on_top_of_the_other_has_height_1(game):
    game.reset(np.random.default_rng(0))
    one, other = game.task.red
    one.place(AWAY)
    other.place((AWAY[0], AWAY[1], 1.5 * EDGE))
    *_, terms = sit(game, 0.6)
    assert terms["height"] == pytest.approx(1.0, abs=0.03)
    assert game.task.solved(game.players[0])
    assert game.reward_of(terms) == pytest.approx(game.world.clock.step_s, rel=0.03)


def test_a_raised_block_has_no_height_and_does_not_solve_the_task(game):
    game.reset(np.random.default_rng(0))
    one, other = game.task.red
    one.place(AWAY)
    other.place((AWAY[0] + 0.2, AWAY[1], 0.5), velocity=(0.0, 0.0, 1.0))
    *_, terms = sit(game, 0.08)
    assert other.position[2] > 0.4
    assert terms["height"] == 0.0
    assert not game.task.solved(game.players[0])


def test_a_block_at_the_highest_point_of_a_throw_has_no_height(game):
    game.reset(np.random.default_rng(0))
    one, other = game.task.red
    one.place(AWAY)
    step_s = game.world.clock.step_s
    other.place((AWAY[0] + 0.2, AWAY[1], 0.5), velocity=(0.0, 0.0, 9.81 * step_s))
    (terms,) = sit(game, step_s)
    assert np.linalg.norm(other.velocity) < 0.05
    assert terms["height"] == pytest.approx(0.0, abs=0.03)


def test_the_blue_block_has_no_height(game):
    game.reset(np.random.default_rng(0))
    one, _ = game.task.red
    one.place(AWAY)
    game.task.blue.place((AWAY[0], AWAY[1], 1.5 * EDGE))
    received = list(sit(game, 0.6))
    assert received[-1]["height"] == pytest.approx(0.0, abs=0.03)
    assert sum(terms["lift"] for terms in received) == pytest.approx(0.0, abs=0.03)
    assert not game.task.solved(game.players[0])


def test_a_red_block_on_the_blue_one_has_a_height(game):
    game.reset(np.random.default_rng(0))
    one, _ = game.task.red
    game.task.blue.place(AWAY)
    one.place((AWAY[0], AWAY[1], 1.5 * EDGE))
    *_, terms = sit(game, 0.6)
    assert terms["height"] == pytest.approx(1.0, abs=0.03)
    assert game.task.solved(game.players[0])


@pytest.fixture(scope="module")
def piling(game):
    """Return of an episode in which the expert piles the blocks up."""
    for seed in EXPERT_SEEDS:
        total, solved = play(game, seed)
        if solved:
            return game.reward_of(total)
    raise AssertionError("the expert piles the blocks up in no episode")


def play_commands(game, commands):
    """Play target angles to the end of the episode; yield the terms of every step."""
    player = game.players[0]
    while game.steps < game.max_steps:
        row = player.body.encode(next(commands))
        yield game.step({player.name: row}).terms[player.name]


@pytest.mark.slow
def test_a_block_that_is_held_up_has_a_lower_return_than_a_pile(game, piling):
    game.reset(np.random.default_rng(0))
    child, (held, other) = game.task.child, game.task.red
    held.place((0.25, 0.0, EDGE / 2))
    other.place(AWAY)
    game.task.blue.place((AWAY[0], -AWAY[1], EDGE / 2))
    gained, high, commands = (
        0.0,
        0,
        lift(child, PalmMotion(child, game.world.clock.step_s), held, height_m=0.2),
    )
    for terms in play_commands(game, commands):
        gained += game.reward_of(terms)
        high += height_in_edges(held) > 2.0 and is_at_rest(held) and child.touches(held)
        assert not game.task.solved(game.players[0])
    assert high > game.max_steps / 2  # higher than a pile, and still: only the hands prevent it
    assert gained == pytest.approx(game.weights["lift"], abs=0.1)
    assert gained < 0.5 * piling


def test_a_block_between_two_that_are_pressed_to_its_sides_is_not_released(game, monkeypatch):
    """Both outer blocks are held, as by two hands; the one between has no contact with the body."""
    game.reset(np.random.default_rng(0))
    (middle, right), left, client = game.task.red, game.task.blue, game.world.client
    child, apart_m, height_m = game.task.child, EDGE - 0.0008, 0.22
    middle.place((0.45, 0.0, height_m))
    with (
        fixed_at(client, left, (0.45, -apart_m, height_m)),
        fixed_at(client, right, (0.45, apart_m, height_m)),
    ):
        monkeypatch.setattr(child, "touches", lambda prop: prop in (left, right))
        carried = [terms["height"] for terms in sit(game, 1.0)]
        assert middle.position[2] == pytest.approx(height_m, abs=0.02)
        assert middle.touches(left.body_id)
        assert middle.touches(right.body_id)
    assert max(carried) == 0.0


@contextmanager
def fixed_at(client, block, place):
    """Keep a block at a place by a constraint."""
    block.place(place)
    constraint = client.createConstraint(
        block.body_id, -1, -1, -1, pybullet.JOINT_FIXED, (0, 0, 0), (0, 0, 0), place
    )
    yield
    client.removeConstraint(constraint)


def gripping(palms, block):
    """Yield target angles, endlessly: close both hands round a block, under its top."""
    place = block.position - np.array([0.0, 0.0, 0.02])
    yield from palms.during(Grip(place, EDGE + 0.06), 2.4)
    while True:
        yield palms.move(Grip(place, EDGE - 0.04))


def test_a_block_on_one_that_is_held_up_has_a_lower_return_than_a_pile(game, piling):
    """A constraint keeps the lower block level, in the place of a strong grip.

    The upper one is put back on it again and again: hands that close push it off.
    """
    game.reset(np.random.default_rng(0))
    child, (block, other), base = game.task.child, game.task.red, game.task.blue
    other.place(AWAY)
    block.place((AWAY[0], -AWAY[1], EDGE / 2))
    gained, lying = 0.0, 0
    with fixed_at(game.world.client, base, (0.25, 0.0, 0.2)):
        for terms in play_commands(
            game, gripping(PalmMotion(child, game.world.clock.step_s), base)
        ):
            if game.steps >= 100 and game.steps % 10 == 0:
                block.place((0.27, 0.0, 0.2 + EDGE + 0.001))
            gained += game.reward_of(terms)
            lying += rests_on(block, base) and is_released(block, child) and child.touches(base)
    assert lying > 60
    assert height_in_edges(block) > 3.0
    assert gained < 0.5 * piling
    assert not game.task.solved(game.players[0])


def test_putting_a_block_down_takes_the_reward_for_lifting_back(game):
    game.reset(np.random.default_rng(0))
    one, _ = game.task.red
    received = 0.0
    for height in (0.5, 1.0, 3.0, 0.5):
        one.place((AWAY[0], AWAY[1], height * EDGE))
        received += next(iter(sit(game, 0.04)))["lift"]
    assert abs(received) < 0.1


def test_blocks_side_by_side_are_not_piled_up(game):
    game.reset(np.random.default_rng(0))
    one, other = game.task.red
    one.place(AWAY)
    other.place((AWAY[0] + EDGE, AWAY[1], EDGE / 2))
    *_, terms = sit(game, 0.4)
    assert abs(terms["height"]) < 0.05
    assert not game.task.solved(game.players[0])


def test_a_touched_pile_is_not_solved(game):
    game.reset(np.random.default_rng(0))
    one, other = game.task.red
    hand = game.players[0].body.bone("l_hand").position
    one.place((hand[0], hand[1], EDGE / 2))
    other.place((hand[0], hand[1], 1.5 * EDGE))
    for _ in sit(game, 0.04):
        assert not game.task.solved(game.players[0])


@pytest.mark.slow
def test_the_expert_piles_up(game):
    heights, solved = [], 0
    for seed in EXPERT_SEEDS:
        total, piled_up = play(game, seed)
        heights.append(total["height"])
        solved += piled_up
        assert sits(game)
    assert solved >= 1
    assert np.mean(heights) > 0.1 * game.max_steps

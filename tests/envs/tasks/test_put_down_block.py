"""PutDownBlock: reward, success criterion, start and expert."""

import numpy as np
import pytest
from blocks import blocks_game, play, sit, sits

from veca_marl.checks.starts import overlaps

EDGE = 0.06
EXPERT_SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def game():
    game = blocks_game("PutDownBlock")
    yield game
    game.close()


def test_the_tower_stands_on_either_side_with_the_red_block_on_top(game):
    sides = []
    for seed in range(30):
        game.reset(np.random.default_rng(seed))
        tower = [block.position for block in (*game.task.blue, game.task.red)]
        np.testing.assert_allclose(
            np.diff(tower, axis=0), [[0.0, 0.0, EDGE + 0.002]] * 2, atol=1e-9
        )
        sides.append(tower[0][1])
    assert min(sides) < -0.05
    assert max(sides) > 0.05


@pytest.mark.parametrize("numbers", [(0.03, 2), (0.06, 2), (0.06, 3), (0.1, 2)])
def test_the_tower_is_clear_of_the_body_from_the_least_distance_on(numbers):
    edge_m, blue = numbers
    ahead_m = (2.0 / 3.0 * (blue + 1) + 0.5) * edge_m + 1e-9
    words = (f"task.edge_m={edge_m}", f"task.blue={blue}", f"task.ahead_m=[{ahead_m},{ahead_m}]")
    game = blocks_game("PutDownBlock", *words, "task.aside_m=[0,0.05]")
    for seed in range(10):
        game.reset(np.random.default_rng(seed))
        assert not overlaps(game), seed
    game.close()


def test_the_tower_stands_while_the_body_sits_still(game):
    game.reset(np.random.default_rng(1))
    for terms in sit(game, 0.2):
        assert terms["blue_fell"] == 0.0
        # it falls through gaps of 0.07 edges
        assert terms["height"] == pytest.approx(2.0, abs=0.1)
    for terms in sit(game, 0.2):  # hands that sink may touch and tilt it from now on
        assert terms["blue_fell"] == 0.0
        assert terms["height"] > 1.4
    assert sits(game)
    assert not game.task.solved(game.players[0])


def test_the_reward_is_negative_until_the_red_block_is_on_the_floor(game):
    game.reset(np.random.default_rng(0))
    *_, up = sit(game, 0.2)
    assert game.reward_of(up) == pytest.approx(-2.0 * game.world.clock.step_s, rel=0.03)
    game.task.red.place((1.0, 1.0, EDGE / 2))
    *_, down = sit(game, 0.2)  # later a hand that sinks touches the tower
    assert game.reward_of(down) == pytest.approx(0.0, abs=0.002)
    assert game.task.solved(game.players[0])


def test_a_fallen_blue_block_counts_once(game):
    game.reset(np.random.default_rng(0))
    game.task.blue[1].place((1.0, -1.0, EDGE / 2))
    fell = [terms["blue_fell"] for terms in sit(game, 1.0)]
    assert sum(fell) == 1.0
    game.task.red.place((1.0, 1.0, EDGE / 2))
    list(sit(game, 0.4))
    assert not game.task.solved(game.players[0])


def test_reset_clears_the_fallen_blocks(game):
    game.reset(np.random.default_rng(0))
    game.task.blue[1].place((1.0, -1.0, EDGE / 2))
    list(sit(game, 0.1))
    game.reset(np.random.default_rng(0))
    assert sum(terms["blue_fell"] for terms in sit(game, 0.2)) == 0.0


@pytest.mark.parametrize("changes", [[], ["task.blue=3"], ["task.max_seconds=40"]])
def test_a_collapse_of_the_tower_has_a_lower_return_than_doing_nothing(changes):
    """The red block and the blue one below it are swept to the floor at once."""
    game = blocks_game("PutDownBlock", *changes)
    game.reset(np.random.default_rng(0))
    task = game.task
    still = task.cfg.blue * game.max_steps * game.weights["height"]
    for block, aside in ((task.blue[-1], -0.5), (task.red, 0.5)):
        block.place((1.0, aside, EDGE / 2))
    swept = sum(game.reward_of(terms) for terms in sit(game, 1.0))
    assert swept < 1.2 * still < 0.0
    game.close()


@pytest.mark.slow
def test_the_expert_puts_the_red_block_down_and_leaves_the_tower_in_place(game):
    results, moved = [], []
    for seed in EXPERT_SEEDS:
        game.reset(np.random.default_rng(seed))
        before = game.task.blue[1].position
        results.append(play(game, seed))
        moved.append(np.linalg.norm(game.task.blue[1].position - before))
    assert sum(solved for _, solved in results) >= 2
    # a body that does nothing has twice this height
    assert np.median([total["height"] for total, _ in results]) < game.max_steps
    assert sum(total["blue_fell"] == 0.0 for total, _ in results) >= 2
    assert np.median(moved) < EDGE / 2
    assert sits(game)

"""PutDownBlock: what is paid, what counts as put down, and that the expert can."""

import numpy as np
import pytest
from blocks import blocks_game, play, sit, sits

from veca_marl.envs.tasks.objects.put_down_block import PutDownBlockCfg

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


def test_the_tower_stands_while_the_child_sits_still(game):
    game.reset(np.random.default_rng(1))
    for terms in sit(game, 0.4):
        assert terms["blue_fell"] == 0.0
        assert terms["height"] == pytest.approx(2.0, abs=0.08)
    assert sits(game)
    assert not game.task.solved


def test_a_red_block_that_is_up_costs_and_on_the_floor_costs_nothing(game):
    game.reset(np.random.default_rng(0))
    *_, up = sit(game, 0.2)
    assert game.reward_of(up) == pytest.approx(-2.0 * game.world.clock.step_s, rel=0.03)
    game.task.red.place((1.0, 1.0, EDGE / 2))
    *_, down = sit(game, 0.4)
    assert game.reward_of(down) == pytest.approx(0.0, abs=0.002)
    assert game.task.solved


def test_a_blue_block_falls_once(game):
    game.reset(np.random.default_rng(0))
    game.task.blue[1].place((1.0, -1.0, EDGE / 2))
    fell = [terms["blue_fell"] for terms in sit(game, 1.0)]
    assert sum(fell) == 1.0
    game.task.red.place((1.0, 1.0, EDGE / 2))
    list(sit(game, 0.4))
    assert not game.task.solved


def test_a_new_episode_forgets_what_fell(game):
    game.reset(np.random.default_rng(0))
    game.task.blue[1].place((1.0, -1.0, EDGE / 2))
    list(sit(game, 0.1))
    game.reset(np.random.default_rng(0))
    assert sum(terms["blue_fell"] for terms in sit(game, 0.2)) == 0.0


def test_pushing_the_tower_over_does_not_pay(game):
    weights = game.weights
    rest_s = game.cfg.task.max_seconds
    assert weights["blue_fell"] < 0.8 * 2.0 * rest_s * weights["height"] / game.world.clock.step_s


def test_the_expert_puts_the_red_block_down(game):
    results = [play(game, seed) for seed in EXPERT_SEEDS]
    assert sum(solved for _, solved in results) >= 2
    # to sit and look at the tower has twice as much
    assert np.median([total["height"] for total, _ in results]) < game.max_steps
    for total, solved in results:
        assert solved == (total["blue_fell"] == 0.0)  # who fails throws the tower over
    assert sits(game)


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ({"blue": 0}, "blue=0"),
        ({"ahead_m": (0.3, 0.2)}, "ahead_m"),
        ({"fallen": 1.5}, "fallen=1.5"),
    ],
)
def test_what_cannot_be_is_refused(numbers, told):
    with pytest.raises(ValueError, match=told):
        PutDownBlockCfg(**numbers)

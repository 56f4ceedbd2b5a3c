"""RotateCube: what turning earns, what dropping costs, and that it can be done."""

import math

import numpy as np
import pytest

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.objects.rotate_cube import RotateCubeCfg
from veca_marl.sim.geometry import heading_rad


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=RotateCube", "senses/touch=numb"]).game)
    yield game
    game.close()


def play(game, seconds, choose, seed=0):
    rng = np.random.default_rng(seed)
    game.reset(rng)
    steps = round(seconds / 0.04)
    rows = (choose(game) for _ in range(steps))
    return sum(game.step({"agents": row}).terms["agents"]["progress"] for row in rows)


def by_expert(game):
    player = game.players[0]
    return player.body.encode(game.expert_of(player).act({}))


def limp(game):
    return np.zeros(82, np.float32)


def test_the_cube_rests_on_the_hand(game):
    for seed in range(5):
        progress = play(game, 2.0, limp, seed)
        assert game.task.on_hand
        assert abs(progress) < math.radians(15.0)
        assert np.linalg.norm(game.task.cube.velocity) < 0.02


def test_the_target_is_a_turn_to_the_left(game):
    game.reset(np.random.default_rng(1))
    assert game.task.angle_rad == pytest.approx(math.radians(45.0), abs=1e-6)
    turn = game.task.target @ game.task.cube.rotation.T
    assert heading_rad(turn) == pytest.approx(math.radians(45.0), abs=1e-6)


def test_the_expert_turns_it(game):
    progress = play(game, 8.0, by_expert)
    assert game.task.solved
    assert progress == pytest.approx(math.radians(45.0) - game.task.angle_rad, abs=1e-9)


def test_a_dropped_cube_has_earned_nothing(game):
    won = play(game, 4.0, by_expert)
    assert won > 0.3
    game.task.cube.place((1.0, 1.0, 0.02))
    paid = [game.step({"agents": limp(game)}).terms["agents"]["progress"] for _ in range(3)]
    assert won + sum(paid) == pytest.approx(0.0, abs=1e-9)
    assert not game.task.solved


@pytest.mark.parametrize(
    ("numbers", "word"),
    [
        ({"edge_m": 0.0}, "edge_m"),
        ({"lost_m": 0.01}, "lost_m"),
        ({"start_deg": 60.0}, "start_deg"),
        ({"turn_deg": 5.0}, "turn_deg"),
        ({"friction": float("inf")}, "friction"),
    ],
)
def test_impossible_numbers_are_refused(numbers, word):
    with pytest.raises(ValueError, match=word):
        RotateCubeCfg(**numbers)

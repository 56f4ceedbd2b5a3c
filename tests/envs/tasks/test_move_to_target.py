"""MoveToTarget: reward, start, the mark and the expert."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=MoveToTarget", "senses/vision=blind", "senses/touch=numb"]).game)
    yield game
    game.close()


def limp(game):
    return game.step({"agents": np.zeros(82, np.float32)}).terms["agents"]


def test_the_mark_is_beside_the_toy_on_a_random_side(game):
    sides = []
    for seed in range(20):
        game.reset(np.random.default_rng(seed))
        assert 0.08 <= game.task.distance_m <= 0.12
        assert not game.task.solved(game.players[0])
        sides.append(np.sign(game.task.mark.position[1]))
    assert 3 < sides.count(1.0) < 17


def test_progress_is_the_decrease_of_the_distance_to_the_mark(game):
    rng = np.random.default_rng(0)
    game.reset(rng)
    way = game.task.mark.position - game.task.toy.position
    way[2] = 0.0
    far = game.task.distance_m
    game.task.toy.set_velocity(1.0 * way / np.linalg.norm(way))
    received = sum(limp(game)["progress"] for _ in range(3))
    assert received == pytest.approx(far - game.task.distance_m, abs=1e-9)
    assert received > 0.01
    game.task.toy.set_velocity(-1.0 * way / np.linalg.norm(way))
    assert limp(game)["progress"] < 0.0


def test_the_mark_has_no_collision(game):
    rng = np.random.default_rng(0)
    game.reset(rng)
    game.task.toy.place(game.task.mark.position * (1, 1, 0) + np.array([0.0, 0.0, 0.035]))
    limp(game)
    assert game.task.solved(game.players[0])
    assert game.task.toy.position[2] == pytest.approx(0.035, abs=0.002)


@pytest.mark.slow
def test_the_expert_moves_the_toy_to_the_mark(game):
    player, solved = game.players[0], 0
    for seed in range(3):
        rng, over = np.random.default_rng(seed), False
        game.reset(rng)
        while not over:
            row = player.body.encode(game.expert_of(player).act({}))
            over = game.step({"agents": row}).truncated
        solved += game.task.solved(game.players[0])
    assert solved >= 2


def test_the_distance_is_clipped(game):
    rng = np.random.default_rng(0)
    game.reset(rng)
    start = game.task.distance_m
    game.task.toy.place((1.0, 1.0, 0.035))
    assert limp(game)["progress"] == pytest.approx(start - 0.15)
    game.task.toy.place((2.0, 2.0, 0.035))
    assert limp(game)["progress"] == 0.0

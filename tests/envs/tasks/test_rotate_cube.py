"""RotateCube: reward, start and expert."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
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
        # the fingers sink under its weight and turn it by 16 degrees, away from the target
        assert math.radians(-20.0) < progress < math.radians(5.0)
        assert np.linalg.norm(game.task.cube.velocity) < 0.05


def test_the_target_is_a_yaw_of_45_degrees_to_the_left(game):
    game.reset(np.random.default_rng(1))
    assert game.task.angle_rad == pytest.approx(math.radians(45.0), abs=1e-6)
    turn = game.task.target @ game.task.cube.rotation.T
    assert heading_rad(turn) == pytest.approx(math.radians(45.0), abs=1e-6)


def test_the_expert_solves_the_task(game):
    progress = play(game, 8.0, by_expert)
    assert game.task.solved(game.players[0])
    assert progress == pytest.approx(math.radians(45.0) - game.task.angle_rad, abs=1e-9)


def test_a_cube_on_the_floor_beside_the_palm_counts_for_nothing(game):
    """Turned to the target orientation, untouched, 4 cm from the middle of the palm."""
    game.reset(np.random.default_rng(0))
    task = game.task
    palm, half = task.child.palms()[1], task.cfg.edge_m / 2
    aside = math.sqrt(0.04**2 - (palm[2] - half) ** 2) if abs(palm[2] - half) < 0.04 else 0.0
    task.cube.place((palm[0] + aside, palm[1], half), heading_rad(task.target))
    assert math.dist(task.cube.position, palm) < task.cfg.lost_m
    assert task.angle_rad < 1e-6
    assert not task.on_hand
    assert not task.solved(game.players[0])
    task.after_step(np.random.default_rng(0))
    assert task.reward(game.players[0])["progress"] == 0.0


def test_dropping_the_cube_takes_the_progress_back(game):
    won = play(game, 4.0, by_expert)
    assert won > 0.3
    game.task.cube.place((1.0, 1.0, 0.02))
    received = [game.step({"agents": limp(game)}).terms["agents"]["progress"] for _ in range(3)]
    assert won + sum(received) == pytest.approx(0.0, abs=1e-9)
    assert not game.task.solved(game.players[0])

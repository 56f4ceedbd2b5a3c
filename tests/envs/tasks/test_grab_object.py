"""GrabObject: reward, start, gaze and expert."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.objects.toys_and_blocks import both_hands_near, palm_distances_m
from veca_marl.sim.physics.props.prop import follow_physics
from veca_marl.sim.vision import is_visible


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=GrabObject", "senses/vision=blind", "senses/touch=numb"]).game)
    yield game
    game.close()


def play(game, seconds, choose):
    rng, outcomes = np.random.default_rng(0), []
    game.reset(rng)
    for _ in range(round(seconds / 0.04)):
        outcomes.append(game.step({"agents": choose(game)}).terms["agents"])
    return outcomes


def by_expert(game):
    player = game.players[0]
    return player.body.encode(game.expert_of(player).act({}))


def limp(game):
    return np.zeros(82, np.float32)


def test_the_start_is_at_rest(game):
    game.reset(np.random.default_rng(3))
    before = game.task.toy.position
    posture = game.task.child.joint_angles()
    # later the trunk has bent so far that the hands reach the floor beside the toy
    for _ in range(8):
        game.step({"agents": game.players[0].body.encode(posture)})
    assert np.linalg.norm(game.task.toy.position - before) < 0.003
    # its trunk bends under gravity, but the body does not slide or jump
    assert np.linalg.norm(game.task.child.position[:2]) < 0.03
    assert np.abs(game.task.child.velocities()).max() < 1.5


def test_the_hands_are_not_near_the_toy_at_the_start(game):
    task, cfg = game.task, game.task.cfg
    for seed in range(10):
        game.reset(np.random.default_rng(seed))
        assert palm_distances_m(task.child, task.toy).max() > cfg.edge_m / 2 + cfg.near_m
        assert not both_hands_near(task.child, task.toy, cfg)
        assert not task.solved(game.players[0])
        assert game.task.toy.velocity == pytest.approx(np.zeros(3))


def test_the_lift_terms_of_the_expert_sum_to_the_height(game):
    terms = play(game, 4.0, by_expert)
    lift = sum(term["lift"] for term in terms)
    assert game.task.held_m > 0.05
    assert game.task.solved(game.players[0])
    # the terms telescope to the height
    assert lift == pytest.approx(game.task.held_m, abs=1e-9)


def test_releasing_the_toy_takes_the_lift_reward_back(game):
    play(game, 4.0, by_expert)
    held = game.task.held_m
    lost = 0.0
    for _ in range(50):
        lost += game.step({"agents": limp(game)}).terms["agents"]["lift"]
    assert lost < -0.5 * held


def test_a_toy_away_from_the_hands_is_not_rewarded(game):
    game.reset(np.random.default_rng(0))
    game.task.toy.place((0.5, 0.5, 0.3))
    assert game.step({"agents": limp(game)}).terms["agents"]["lift"] == 0.0


def test_tipping_the_toy_between_the_hands_is_not_rewarded(game):
    """Tipped by 30 degrees about an edge on the floor, its centre is 13 mm higher."""
    game.reset(np.random.default_rng(0))
    task, toy = game.task, game.task.toy
    while palm_distances_m(task.child, toy).max() > 0.8 * (task.cfg.edge_m / 2 + task.cfg.near_m):
        game.step({"agents": by_expert(game)})
    edge, tilt = task.cfg.edge_m, math.radians(30.0)
    height = edge / 2 * (math.cos(tilt) + math.sin(tilt))
    tip(toy, (*toy.position[:2], height), tilt)
    assert both_hands_near(task.child, toy, task.cfg)
    assert toy.position[2] > edge / 2 + 0.01
    assert task.held_m == pytest.approx(0.0, abs=1e-6)


def tip(prop, position, pitch_rad):
    """Place a prop with a pitch, which `Prop.place` does not set."""
    turn = (0.0, math.sin(pitch_rad / 2), 0.0, math.cos(pitch_rad / 2))
    prop._client.resetBasePositionAndOrientation(prop.body_id, position, turn)
    follow_physics([prop])


def test_approach_and_effort_have_the_weights_of_the_paper(game):
    assert game.weights["approach"] == 1.0
    assert game.weights["effort"] == -0.004


def test_approach_is_the_decrease_of_both_palm_distances(game):
    game.reset(np.random.default_rng(0))
    toy, child = game.task.toy.position, game.task.child
    before = np.linalg.norm(child.palms() - toy, axis=1).sum()
    terms = play(game, 0.6, by_expert)
    after = np.linalg.norm(child.palms() - game.task.toy.position, axis=1).sum()
    assert sum(term["approach"] for term in terms) == pytest.approx(before - after, abs=1e-9)
    assert after < before


def test_effort_is_the_sum_of_squared_torques(game):
    rng = np.random.default_rng(0)
    game.reset(rng)
    row = rng.uniform(-1.0, 1.0, 82).astype(np.float32)
    effort = game.step({"agents": row}).terms["agents"]["effort"]
    assert effort == pytest.approx(float(row.astype(float) @ row), rel=1e-6)


def test_the_gaze_follows_the_toy(game):
    game.reset(np.random.default_rng(0))
    child, toy = game.task.child, game.task.toy

    def off_axis():
        eye = child.mount("eye_left")
        way = toy.position - eye.position
        return 1.0 - eye.rotation[:, 0] @ way / np.linalg.norm(way)

    looking = off_axis()
    assert is_visible(game.world.scene, child, toy)
    child.release_look()
    assert off_axis() > 2.0 * looking

"""A crawling body that has fallen on its back gets back onto hands and knees and goes on."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.experts.control.posture_transitions import FallRecovery, GetUp
from veca_marl.envs.experts.control.sit_up import SitUp
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS, ON_BACK, ON_BELLY


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=CrawlBaby", "senses/touch=numb", "task.max_seconds=60"]).game)
    yield game
    game.close()


def crawl(game, seconds):
    """Let the expert play; return the distance that the body comes ahead."""
    body = game.players[0].body
    start = body.position
    for _ in range(round(seconds / game.cfg.clock.step_s)):
        game.play_script(game.players[0], Script.expert)
        game.advance()
    return math.dist(body.position[:2], start[:2])


def gets_up(game, posture, seed, within_s):
    """Let the expert crawl, place its body in a posture, and return whether it gets up again."""
    rng = np.random.default_rng(seed)
    game.reset(rng)
    body, player = game.players[0].body, game.players[0]
    game.expert_of(player).reset()
    assert crawl(game, 1.0) > 0.05
    body.place((0.0, 0.0, 0.0), rng.uniform(-math.pi, math.pi), body.perturb(posture, 8.0, rng))
    crawl(game, within_s)
    return body.bone("chest").forward[2] < -0.6


@pytest.mark.slow
@pytest.mark.parametrize("posture", [ON_BACK, ON_BELLY], ids=["back", "belly"])
@pytest.mark.parametrize("seed", [0, 1])
def test_after_a_fall_the_expert_gets_onto_hands_and_knees_and_crawls_on(game, posture, seed):
    assert gets_up(game, posture, seed, within_s=4.0)
    assert crawl(game, 6.0) > 0.6


@pytest.mark.slow
@pytest.mark.parametrize("posture", [ON_BACK, ON_BELLY], ids=["back", "belly"])
def test_it_gets_up_nearly_always_and_at_the_latest_by_its_second_attempt(game, posture):
    assert sum(gets_up(game, posture, seed, within_s=4.0) for seed in range(12)) >= 11
    assert all(gets_up(game, posture, seed, within_s=8.0) for seed in range(12))


def test_a_body_that_crawls_is_left_alone_and_one_that_stays_on_its_back_is_not(game):
    game.reset(np.random.default_rng(5))
    body = game.players[0].body
    recovery = FallRecovery(body, game.cfg.clock.step_s)
    body.place((0.0, 0.0, 0.0), 0.0, ON_ALL_FOURS)
    assert [recovery.command() for _ in range(50)] == [None] * 50
    body.place((0.0, 0.0, 0.0), 0.0, ON_BACK)
    steps = round(0.4 / game.cfg.clock.step_s)
    commands = [recovery.command() for _ in range(steps + 1)]
    assert commands[: steps - 1] == [None] * (steps - 1)
    assert commands[-1] is not None


def play(game, skill, seconds, *, follows, acts):
    """Ask a skill for commands, which the body of a game executes or not."""
    body = game.players[0].body
    for _ in range(round(seconds / game.cfg.clock.step_s)):
        if follows:
            skill.follow_body()
        command = skill.command()
        if acts:
            body.act(body.encode(command))
            game.advance()


def lying(game, posture):
    game.reset(np.random.default_rng(3))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.0, posture)
    return body, game.cfg.clock.step_s


def test_getting_up_waits_for_a_body_that_others_move(game):
    """The body does nothing: by its clock alone the skill would be complete."""
    for follows in (False, True):
        get_up = GetUp(*lying(game, ON_BELLY))
        play(game, get_up, 2.5, follows=follows, acts=False)
        assert get_up.is_complete is not follows


def test_a_body_that_executes_the_labels_gets_up(game):
    body, step_s = lying(game, ON_BACK)
    get_up = GetUp(body, step_s)
    play(game, get_up, 5.0, follows=True, acts=True)
    assert get_up.is_complete
    assert body.bone("neck").position[2] > 0.15


def test_a_body_that_executes_the_labels_sits_up_and_gets_up_again_after_a_fall(game):
    body, step_s = lying(game, ON_BACK)
    sit_up = SitUp(body, step_s)
    play(game, sit_up, 8.0, follows=True, acts=True)
    assert body.bone("neck").position[2] > 0.25
    body.place((0.0, 0.0, 0.0), 0.0, ON_BACK)
    fresh = SitUp(body, step_s)
    sit_up.follow_body()
    assert np.allclose(sit_up.command().targets, fresh.command().targets)

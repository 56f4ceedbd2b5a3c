"""Frozen episodes: what belongs to a start, and which games are refused."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.benchmark import find_benchmark, start_digests
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.starts import start_digest, start_state

QUIET = ("senses/vision=blind",)


@pytest.fixture
def game():
    game = Game(compose(["+task=KickTheBall", *QUIET]).game)
    game.reset(Episodes(0).next())
    yield game
    game.close()


def test_the_state_has_the_poses_of_bones_and_props(game):
    state = start_state(game)
    assert len(state) == 12 * (47 * len(game.players) + len(game.world.props))
    np.testing.assert_allclose(state[:3], game.players[0].body.bone_positions()[0], atol=1e-6)


def test_the_digest_changes_with_poses_and_with_draws_and_leaves_the_generator(game):
    rng = Episodes(5).next()
    first = start_digest(game, rng)
    assert start_digest(game, rng) == first
    assert len(first) == 16
    rng.random()
    assert start_digest(game, rng) != first
    x, y, _ = game.players[0].body.position
    game.players[0].body.place((x + 0.01, y, 0.0))
    assert start_digest(game, Episodes(5).next()) != first


def test_an_episode_has_its_start_whatever_was_played_before():
    cfg = compose(["+task=KickTheBall", *QUIET]).game
    stored = find_benchmark("KickTheBall").starts
    assert start_digests(cfg, 20260, [3, 1]) == [stored[3], stored[1]]


def test_other_senses_are_accepted():
    cfg = compose(["+task=KickTheBall", "senses/audio=mono", *QUIET]).game
    find_benchmark("KickTheBall").check(cfg)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["task.max_seconds=3"], r"version 2, differs in task.max_seconds=3.0 \(not 20.0\)"),
        (["playground=two_rooms"], "of 100 starts are not those of the benchmark of KickTheBall"),
    ],
)
def test_other_parameters_and_playgrounds_are_refused(overrides, message):
    cfg = compose(["+task=KickTheBall", *QUIET, *overrides]).game
    with pytest.raises(ValueError, match=message):
        find_benchmark("KickTheBall").check(cfg)


def test_a_task_without_frozen_episodes_is_refused():
    with pytest.raises(ValueError, match="task 'Chess' has no frozen episodes"):
        find_benchmark("Chess")

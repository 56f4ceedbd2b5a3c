"""CrawlBaby: reward, start and expert."""

import numpy as np
import pytest
from babies import (
    BODIES,
    child_game,
    hold,
    play,
    rest,
    starts,
    terms_at_rest,
)

from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS, ON_BACK


@pytest.fixture(scope="module")
def game():
    with child_game("CrawlBaby") as game:
        yield game


@pytest.mark.parametrize(
    ("shift_m", "received"), [(0.02, 0.5), (-0.02, -0.5), (0.2, 1.0), (-0.2, -5.0)]
)
def test_the_speed_is_clipped_at_the_top_speed_forwards(game, shift_m, received):
    """20 mm in a step of 40 ms are 0.5 m/s."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    game.task._progress.reset(body.position - shift_m * body.forward, body.forward)
    assert rest(game).terms["agents"]["forward"] == pytest.approx(received, abs=0.12)


def test_the_orientation_terms_are_greatest_face_down(game):
    received = terms_at_rest(game, ON_ALL_FOURS)
    assert received["torso"] > 0.9
    assert received["hip"] > 0.9
    received = terms_at_rest(game, ON_BACK)
    assert received["torso"] < -0.9
    assert received["hip"] < -0.9


def test_it_starts_on_hands_and_knees_with_the_room_ahead(game):
    for body in starts(game, 12):
        assert game.world.playground.rooms[0].contains(body.position + 4.5 * body.forward)
        assert body.bone("neck").position[2] > 0.2
        assert np.linalg.norm(body.velocities(), axis=1).max() == 0.0


def test_the_start_holds_if_the_posture_is_held(game):
    for body in starts(game, 4):
        for _ in range(25):
            hold(game, body.posture_angles(ON_ALL_FOURS))
        assert body.bone("neck").position[2] > 0.2
        assert body.bone("chest").forward[2] < -0.8


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_the_expert_crawls_ahead(body):
    rng, ways_m, speeds_mps = np.random.default_rng(3), [], []
    with child_game("CrawlBaby", f"body={body}") as game:
        for _ in range(3):
            outcomes, way_m = play(game, rng)
            speeds_mps += [outcome.terms["agents"]["forward"] for outcome in outcomes]
            ways_m.append(way_m)
    assert min(ways_m) > 1.0
    assert np.mean(speeds_mps) > 0.15

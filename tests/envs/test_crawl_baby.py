"""CrawlBaby: getting ahead pays, the start holds, the expert crawls."""

import numpy as np
import pytest
from babies import baby_game

from veca_marl.envs.tasks.crawl_baby import CrawlBabyCfg
from veca_marl.sim.bodies.postures import ON_ALL_FOURS, ON_BACK


@pytest.fixture(scope="module")
def game():
    game = baby_game("CrawlBaby")
    yield game
    game.close()


def rest(game):
    row = np.zeros(game.players[0].body.action_spec.shape, np.float32)
    return game.step({"agents": row}, np.random.default_rng(0)).terms["agents"]


def play(game, rng):
    """Play one episode of the expert; return its mean terms and the metres it got ahead."""
    player, paid = game.players[0], []
    game.reset(rng)
    start, heading = player.body.position, player.body.forward
    for _ in range(game.max_steps):
        row = player.body.encode(game.task.expert(player, {}))
        paid.append(game.step({player.name: row}, rng).terms[player.name])
    mean = {name: np.mean([step[name] for step in paid]) for name in paid[0]}
    return mean, (player.body.position - start) @ heading


@pytest.mark.parametrize(
    ("shift_m", "paid"), [(0.02, 0.5), (-0.02, -0.5), (0.2, 1.0), (-0.2, -1.0)]
)
def test_getting_ahead_pays_up_to_the_top_speed(game, shift_m, paid):
    """20 mm in a step of 40 ms are 0.5 m/s; going back costs as much."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    game.task._place = body.position - shift_m * body.forward
    assert rest(game)["forward"] == pytest.approx(paid, abs=0.12)


def test_face_down_is_the_right_orientation(game):
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((0.0, 0.0, 0.0), 0.7, ON_ALL_FOURS)
    paid = rest(game)
    assert paid["torso"] > 0.9
    assert paid["hip"] > 0.9
    game.players[0].body.place((0.0, 0.0, 0.0), 0.7, ON_BACK)
    paid = rest(game)
    assert paid["torso"] < -0.9
    assert paid["hip"] < -0.9


def test_it_starts_on_hands_and_knees_with_the_room_ahead(game):
    for seed in range(12):
        game.reset(np.random.default_rng(seed))
        body = game.players[0].body
        assert game.task.room.contains(body.position + 4.5 * body.forward)
        assert body.bone("neck").position[2] > 0.2
        assert np.linalg.norm(body.velocities(), axis=1).max() == 0.0


def test_the_start_holds_if_the_posture_is_held(game):
    for seed in range(4):
        game.reset(np.random.default_rng(seed))
        body = game.players[0].body
        angles = body.angles_of(ON_ALL_FOURS)
        for _ in range(25):
            game.step({"agents": body.encode(angles)}, np.random.default_rng(0))
        assert body.bone("neck").position[2] > 0.2
        assert body.bone("chest").forward[2] < -0.8


@pytest.mark.parametrize("body", ["mitten_limbs", "mitten_position"])
def test_the_expert_crawls_ahead(body):
    game, rng = baby_game("CrawlBaby", f"body={body}"), np.random.default_rng(3)
    ways = [play(game, rng) for _ in range(3)]
    assert np.mean([way for _, way in ways]) > 0.2
    assert np.mean([mean["forward"] for mean, _ in ways]) > 0.04
    game.close()


def test_a_walker_is_refused():
    with pytest.raises(ValueError, match="body with joints"):
        baby_game("CrawlBaby", "body=walker")


@pytest.mark.parametrize(
    "wrong", [{"spread_deg": -1.0}, {"top_mps": 0.0}, {"top_mps": float("inf")}]
)
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CrawlBabyCfg(**wrong)

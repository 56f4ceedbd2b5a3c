"""RunBaby: getting ahead on two feet pays, a fall ends it, the expert gets further than chance."""

import numpy as np
import pytest
from babies import baby_game

from veca_marl.envs.tasks.run_baby import RunBabyCfg
from veca_marl.sim.bodies.postures import ON_ALL_FOURS, ON_BELLY, STANDING


@pytest.fixture(scope="module")
def game():
    game = baby_game("RunBaby")
    yield game
    game.close()


def rest(game):
    row = np.zeros(game.players[0].body.action_spec.shape, np.float32)
    return game.step({"agents": row}, np.random.default_rng(0))


def shifted(game, posture, shift_m):
    """Return the term of a step of rest in which the chest got so far ahead."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.7, posture)
    game.task._place = body.bone("chest").position - shift_m * body.forward
    return rest(game).terms["agents"]["forward"]


@pytest.mark.parametrize(("shift_m", "paid"), [(0.04, 1.0), (-0.04, -1.0), (1.0, 2.0), (0.0, 0.0)])
def test_getting_ahead_pays_up_to_the_top_speed(game, shift_m, paid):
    assert shifted(game, STANDING, shift_m) == pytest.approx(paid, abs=0.1)


@pytest.mark.parametrize("posture", [ON_ALL_FOURS, ON_BELLY])
def test_getting_ahead_face_down_pays_next_to_nothing(game, posture):
    assert abs(shifted(game, posture, 0.04)) < 0.2


@pytest.mark.parametrize(("posture", "over"), [(STANDING, False), (ON_ALL_FOURS, True)])
def test_a_fall_ends_the_episode(game, posture, over):
    game.reset(np.random.default_rng(1))
    game.players[0].body.place((0.0, 0.0, 0.0), 0.7, posture)
    assert rest(game).terminated == over


def test_a_fall_may_be_allowed():
    game = baby_game("RunBaby", "task.fallen_m=0.0")
    game.players[0].body.place((0.0, 0.0, 0.0), 0.7, ON_BELLY)
    assert not rest(game).terminated
    game.close()


def test_it_starts_standing_with_the_room_ahead(game):
    for seed in range(8):
        game.reset(np.random.default_rng(seed))
        body = game.players[0].body
        assert game.task.room.contains(body.position + 4.5 * body.forward)
        assert body.bone("neck").position[2] > 0.58
        angles = body.joint_angles()
        for _ in range(12):
            outcome = game.step({"agents": body.encode(angles)}, np.random.default_rng(0))
        assert not outcome.terminated


@pytest.mark.parametrize(("body", "way_m"), [("mitten_limbs", 0.2), ("mitten_position", 0.05)])
def test_the_expert_gets_ahead(body, way_m):
    game, rng = baby_game("RunBaby", f"body={body}"), np.random.default_rng(3)
    player, ways = game.players[0], []
    for _ in range(6):
        game.reset(rng)
        start, heading, over = player.body.position, player.body.forward, False
        while not over:
            row = player.body.encode(game.task.expert(player, {}))
            outcome = game.step({player.name: row}, rng)
            over = outcome.done
        ways.append((player.body.position - start) @ heading)
    assert np.mean(ways) > way_m
    game.close()


def test_a_walker_is_refused():
    with pytest.raises(ValueError, match="body with joints"):
        baby_game("RunBaby", "body=walker")


@pytest.mark.parametrize("wrong", [{"spread_deg": -1.0}, {"top_mps": 0.0}, {"fallen_m": 0.7}])
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        RunBabyCfg(**wrong)

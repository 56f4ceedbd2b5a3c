"""RunBaby: reward, termination, start and expert."""

import math

import numpy as np
import pytest
from babies import child_game, hold, play, put, rest, starts

from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS, ON_BELLY, STANDING, Posture


@pytest.fixture(scope="module")
def game():
    with child_game("RunBaby") as game:
        yield game


def shifted(game, posture, shift_m):
    """Return the term of a step in which the whole body has moved forwards by a distance."""
    return shifted_parts(game, posture, shift_m, np.array([shift_m, shift_m]))


def shifted_parts(game, posture, chest_m, toes_m):
    """Return the term of a step in which chest and toes have moved forwards by distances."""
    body, task = put(game, posture), game.task
    task._begin()
    task._chest.reset(body.bone("chest").position - chest_m * body.forward, body.forward)
    task._toes_start_m = task._toes_start_m - toes_m
    return rest(game).terms["agents"]["forward"]


@pytest.mark.parametrize(("shift_m", "term"), [(0.04, 1.0), (-0.04, -1.0), (1.0, 2.0), (0.0, 0.0)])
def test_the_speed_is_clipped_at_the_top_speed(game, shift_m, term):
    assert shifted(game, STANDING, shift_m) == pytest.approx(term, abs=0.1)


def test_a_fast_motion_backwards_is_not_clipped(game):
    assert shifted(game, STANDING, -0.2) == pytest.approx(-5.0, abs=0.1)


@pytest.mark.parametrize("posture", [ON_ALL_FOURS, ON_BELLY])
def test_motion_face_down_is_hardly_rewarded(game, posture):
    assert abs(shifted(game, posture, 0.04)) < 0.2


@pytest.mark.parametrize(
    ("chest_m", "toes_m", "term"),
    [
        (0.04, (0.0, 0.0), 0.0),  # the body leans forwards
        (0.04, (0.1, 0.0), 0.0),  # one foot is kicked ahead
        (0.0, (0.04, 0.04), 0.0),  # both feet slide from under the body
        (0.04, (0.1, 0.02), 0.5),
        (0.04, (-0.02, 0.1), -0.5),
    ],
)
def test_the_least_distance_of_chest_and_feet_counts(game, chest_m, toes_m, term):
    found = shifted_parts(game, STANDING, chest_m, np.array(toes_m))
    assert found == pytest.approx(term, abs=0.1)


def test_a_step_of_each_foot_pays_what_the_chest_covered(game):
    """While one foot is ahead there is no reward; when the other one follows, all of it."""
    put(game, STANDING)
    task = game.task
    task._begin()
    task._chest_m, task._toes_start_m = 0.1, task._toes_start_m - np.array([0.2, 0.0])
    assert rest(game).terms["agents"]["forward"] == pytest.approx(0.0, abs=0.1)
    task._toes_start_m = task._toes_start_m - np.array([0.0, 0.1])
    assert rest(game).terms["agents"]["forward"] == pytest.approx(2.5, abs=0.2)


# of all constant postures that were tried it moved the chest farthest; hips end at -10 degrees
PLANK = Posture(0.0, {"foot.dorsiflexion": 20.0, "thigh.flexion": -10.0, "spine.flexion": -15.0})


def test_a_fall_like_a_plank_earns_nothing(game):
    """The chest moves ahead by almost half a metre, the toes stay where they are."""
    player, returns, chest_m = game.players[0], [], []
    for body in starts(game, 6):
        begin, heading, earned = body.bone("chest").position, body.forward, 0.0
        target = body.posture_angles(PLANK)
        outcome = hold(game, target)
        while not outcome.done:
            earned += game.reward_of(outcome.terms[player.name])
            outcome = hold(game, target)
        returns.append(earned + game.reward_of(outcome.terms[player.name]))
        chest_m.append((body.bone("chest").position - begin) @ heading)
    assert np.mean(chest_m) > 0.4
    assert np.mean(returns) < 0.05
    assert max(returns) < 0.1


UPRIGHT_ON_KNEES = Posture(0.0, {"shank.flexion": 90.0, "foot.dorsiflexion": -45.0})


@pytest.mark.parametrize(
    ("posture", "over"), [(STANDING, False), (ON_ALL_FOURS, True), (UPRIGHT_ON_KNEES, True)]
)
def test_a_fall_ends_the_episode(game, posture, over):
    put(game, posture)
    assert rest(game).terminated == over


def test_kneeling_upright_is_no_fall_by_the_height_of_the_chest(game):
    """Otherwise walking on the knees would be running."""
    assert put(game, UPRIGHT_ON_KNEES).bone("neck").position[2] > game.task.cfg.fallen_m


def knee_walk(seconds, hertz):
    """Posture of a gait on the knees: the thighs swing in turns, the shanks lie on the floor."""
    swing = 21.0 * math.sin(math.tau * hertz * seconds)
    return Posture(
        0.0,
        UPRIGHT_ON_KNEES.joints_deg
        | {
            "spine.flexion": -12.5,
            "l_thigh.flexion": max(-9.0, -2.0 + swing),
            "r_thigh.flexion": max(-9.0, -2.0 - swing),
        },
    )


def knee_walked_m(game, hertz):
    """Distance that counts of a walk on the knees until the episode ends, and its steps."""
    body = put(game, knee_walk(0.0, hertz))
    game.task._begin()
    covered_m = 0.0
    for step in range(75):
        outcome = hold(game, body.posture_angles(knee_walk(0.04 * step, hertz)))
        covered_m += 0.04 * outcome.terms["agents"]["forward"]
        if outcome.done:
            break
    return covered_m, step + 1


def test_walking_on_the_knees_earns_nothing(game):
    """Without the rule about knees the same gait counts for more than 0.15 m."""
    rates_hz = (2.1, 2.2, 2.3, 2.4)
    with child_game("RunBaby", "task.kneeling_m=0.0") as lenient:
        assert max(knee_walked_m(lenient, hertz)[0] for hertz in rates_hz) > 0.15
    for hertz in rates_hz:
        covered_m, steps = knee_walked_m(game, hertz)
        assert steps == 1
        assert abs(covered_m) < 0.01


def test_the_termination_by_a_fall_can_be_turned_off():
    with child_game("RunBaby", "task.fallen_m=0.0", "task.kneeling_m=0.0") as game:
        put(game, ON_BELLY)
        assert not rest(game).terminated


def test_it_starts_standing_with_the_room_ahead(game):
    for body in starts(game, 8):
        assert game.world.playground.rooms[0].contains(body.position + 4.5 * body.forward)
        assert body.bone("neck").position[2] > 0.58
        angles = body.joint_angles()
        for _ in range(12):
            outcome = hold(game, angles)
        assert not outcome.terminated


@pytest.mark.slow
@pytest.mark.parametrize("body", ["mitten_limbs", "full"])
def test_the_expert_makes_steps_before_it_falls(body):
    """Both feet and the chest come ahead; a body that falls like a plank leaves its feet behind."""
    rng = np.random.default_rng(3)
    with child_game("RunBaby", f"body={body}") as game:
        episodes = [play(game, rng)[0] for _ in range(6)]
    speeds_mps = [[outcome.terms["agents"]["forward"] for outcome in each] for each in episodes]
    assert np.mean([0.04 * sum(each) for each in speeds_mps]) > 0.2

"""SoccerOnePlayer and SoccerTwoPlayer: goals, rewards, kicks and experts."""

import math
from contextlib import closing

import numpy as np
import pytest
from contests import episodes, game_of, rest, total_reward

from veca_marl.checks.starts import overlaps
from veca_marl.envs.tasks.soccer_pitch import CHILD_M

GAMES = 15


@pytest.fixture(scope="module")
def alone():
    game = game_of("SoccerOnePlayer")
    yield game
    game.close()


@pytest.fixture(scope="module")
def two():
    game = game_of("SoccerTwoPlayer")
    yield game
    game.close()


def begin(game, ball=None, velocity=(0.0, 0.0, 0.0)):
    """Start with the players far from the ball, which has a position and a velocity."""
    game.reset(np.random.default_rng(0))
    for number, player in enumerate(game.players):
        player.body.place((-2.5, 2.0 * number - 1.0, 0.0))
    if ball is not None:
        game.task.ball.place(np.array(ball), 0.0)
        game.task.ball.set_velocity(np.array(velocity))
        game.task._state = game.task._observe_state()


def roll_in(game, ball, velocity, seconds=1.5):
    begin(game, ball, velocity)
    for _ in range(round(seconds / 0.04)):
        (outcome,) = rest(game)
        if outcome.done:
            break
    return outcome


def test_a_goal_terminates_the_game_and_is_zero_sum(two):
    outcome = roll_in(two, (2.0, 0.2, 0.12), (2.0, 0.0, 0.0))
    assert outcome.terminated
    assert outcome.terms["attacker"]["goal"] == 1.0
    assert outcome.terms["defender"]["goal"] == -1.0


def test_the_goal_counts_in_the_step_in_which_the_centre_passes_the_line(alone):
    begin(alone, (2.2, 0.0, 0.12), (1.0, 0.0, 0.0))
    for _ in range(20):
        before = alone.task.ball.position[0]
        (outcome,) = rest(alone)
        after = alone.task.ball.position[0]
        assert outcome.terminated == (before < 2.5 <= after)
        if outcome.terminated:
            break
    assert outcome.terminated


@pytest.mark.parametrize(
    ("before", "after", "counts"),
    [
        ((2.4, 0.0, 0.1), (2.6, 0.0, 0.1), True),
        ((2.4, 0.69, 0.1), (2.6, 0.69, 0.1), True),
        ((2.4, 0.71, 0.1), (2.6, 0.71, 0.1), False),
        ((2.4, -0.6, 0.1), (2.6, -0.9, 0.1), False),  # beside the post where it passes the line
        ((2.4, 0.0, 0.79), (2.6, 0.0, 0.79), True),
        ((2.4, 0.0, 0.85), (2.6, 0.0, 0.85), False),
        ((2.6, 0.0, 0.1), (2.4, 0.0, 0.1), False),  # from behind
        ((2.3, 0.0, 0.1), (2.49, 0.0, 0.1), False),
    ],
)
def test_a_goal_is_between_the_posts_under_the_bar_from_the_front(alone, before, after, counts):
    assert alone.task.pitch.scores(np.array(before), np.array(after)) is counts


def test_a_ball_that_fits_behind_the_line_scores_against_the_wall():
    with closing(game_of("SoccerOnePlayer", "task.goal_from_wall_m=0.13")) as game:
        x, y, _ = game.task.goal
        assert roll_in(game, (x - 0.6, y, 0.12), (2.0, 0.0, 0.0)).terminated


@pytest.mark.parametrize("radius_m", [0.06, 0.12, 0.3])
def test_bodies_on_hands_and_knees_start_clear_of_the_ball(radius_m):
    near = radius_m + CHILD_M
    words = [f"task.radius_m={radius_m}", f"task.attacker_from_ball_m=[{near},{near}]"]
    words += [f"task.ball_from_goal_m=[{near + 0.3},{near + 0.3}]", "task.aside_m=0"]
    words += ["task.defender_from_goal_m=[0.3,0.3]", "body=mitten"]
    with closing(game_of("SoccerTwoPlayer", *words)) as game:
        for seed in range(5):
            game.reset(np.random.default_rng(seed))
            assert not [pair for pair in overlaps(game) if "ball" in pair]


def test_boards_close_the_goal_line_beside_the_goal(alone):
    outcome = roll_in(alone, (1.8, 1.3, 0.12), (2.0, 0.0, 0.0))
    assert not outcome.terminated
    assert alone.task.ball.position[0] < 2.4


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_ball_rebounds_from_every_corner(alone, side):
    for x in (-1.0, 1.0):
        roll_in(alone, (x * 2.0, side * 2.5, 0.12), (x * 1.5, side * 1.0, 0.0), 2.0)
        place = np.abs(alone.task.ball.position[:2])
        assert place.sum() < 3.0 + 3.0 - 0.5


def test_every_term_is_zero_sum(two):
    goals = 0
    for outcomes in episodes(two, 4, attacker="expert", defender="random"):
        for outcome in outcomes:
            assert total_reward(two, outcome) == pytest.approx(0.0, abs=1e-12)
            for name, received in outcome.terms["attacker"].items():
                assert received == -outcome.terms["defender"][name]
        goals += outcomes[-1].terminated
    assert goals >= 2


def test_progress_is_the_decrease_of_the_distance_to_the_goal(alone):
    begin(alone, (0.0, 0.5, 0.12), (0.6, 0.0, 0.0))
    start = math.dist(alone.task.ball.position[:2], alone.task.goal[:2])
    total = sum(outcome.terms["attacker"]["progress"] for outcome in rest(alone, 1.0))
    decrease = start - math.dist(alone.task.ball.position[:2], alone.task.goal[:2])
    assert decrease > 0.2
    assert total == pytest.approx(decrease, abs=1e-9)


def test_facing_sums_to_the_decrease_of_the_angle(alone):
    begin(alone, (0.0, 0.0, 0.12))
    body = alone.players[0].body
    body.place((-2.0, 0.0, 0.0), math.radians(100.0))
    alone.task._state = alone.task._observe_state()
    received = []
    for turn in (-1.0,) * 15 + (1.0,) * 10:
        outcome = alone.step({"attacker": np.array([0.0, turn], np.float32)})
        received.append(outcome.terms["attacker"]["facing"])
    assert min(received[:15]) > 0.0 > max(received[15:])
    assert sum(received) == pytest.approx(math.radians(100.0) - abs(body.yaw_rad), abs=1e-9)


def test_approach_ignores_the_motion_of_the_ball(alone):
    begin(alone, (0.0, 0.0, 0.12))
    body = alone.players[0].body
    body.place((-1.5, 0.0, 0.0))
    alone.task._state = alone.task._observe_state()
    rows = {"attacker": np.array([1.0, 0.0], np.float32)}
    steps = [alone.step(rows) for _ in range(10)]
    total = sum(outcome.terms["attacker"]["approach"] for outcome in steps)
    assert total == pytest.approx(body.position[0] + 1.5, abs=1e-6)
    begin(alone, (0.0, 0.0, 0.12), (1.0, 0.0, 0.0))
    for outcome in rest(alone, 1.0):
        assert outcome.terms["attacker"]["approach"] == pytest.approx(0.0, abs=1e-9)


def test_chasing_the_ball_for_an_episode_is_worth_less_than_a_goal():
    """The ball is moved away from the player in each step."""
    with closing(game_of("SoccerOnePlayer", "body=walker")) as game:
        game.reset(np.random.default_rng(0))
        body, ball, turn = game.players[0].body, game.task.ball, 0.3
        terms = []
        while game.steps < game.max_steps:
            row = np.array([1.0, turn], np.float32)
            terms.append(game.step({"attacker": row}).terms["attacker"])
            ball.place(body.position + 0.8 * body.forward + [0.0, 0.0, 0.2])
            game.task._state = game.task._observe_state()
        chased = sum(game.weights["approach"] * each["approach"] for each in terms)
    assert 0.8 < chased < 1.001 < game.weights["goal"]


def test_a_game_without_a_goal_is_truncated():
    game = game_of("SoccerTwoPlayer", "task.max_seconds=0.4")
    *_, last = rest(game, 0.4)
    assert last.truncated
    assert not last.terminated
    assert last.terms["attacker"]["goal"] == 0.0
    game.close()


def test_players_and_ball_start_within_the_configured_ranges(two):
    asides = []
    for seed in range(30):
        two.reset(np.random.default_rng(seed))
        attacker, defender = (player.body for player in two.players)
        ball = two.task.ball.position
        assert 2.0 <= 2.5 - ball[0] <= 2.8
        assert 0.8 <= ball[0] - attacker.position[0] <= 1.6
        assert 0.3 <= 2.5 - defender.position[0] <= 0.8
        for body in (attacker, defender):
            way = (ball - body.position)[:2]
            assert body.forward[:2] @ way > np.hypot(*way) * math.cos(math.radians(30.1))
        asides.append(ball[1])
    assert max(np.abs(asides)) <= 0.8
    assert np.ptp(asides) > 0.8


def at_the_ball(game, forward):
    """Let the attacker walk or stand at the ball; return the greatest speed of the ball."""
    begin(game, (0.0, 0.0, 0.12))
    game.players[0].body.place((-0.42, 0.0, 0.0))
    rows = {p.name: np.zeros(2, np.float32) for p in game.players}
    rows["attacker"][0] = forward
    fastest = 0.0
    for _ in range(10):
        game.step(rows)
        fastest = max(fastest, float(game.task.ball.velocity[0]))
    return fastest


def test_a_walking_player_kicks_and_a_standing_one_does_not(two):
    assert at_the_ball(two, 1.0) > 1.8
    assert at_the_ball(two, 0.0) == pytest.approx(0.0, abs=0.05)


def test_a_player_kicks_at_most_once_per_rest_time(alone):
    begin(alone, (0.0, 0.0, 0.12))
    body, ball, kicks = alone.players[0].body, alone.task.ball, []
    for step in range(40):
        ball.place(np.array([0.0, 0.0, 0.12]), 0.0)
        body.place((-0.36, 0.0, 0.0))
        alone.step({"attacker": np.array([1.0, 0.0], np.float32)})
        if ball.velocity[0] > 1.5:
            kicks.append(step)
    assert len(kicks) >= 3
    assert min(np.diff(kicks)) >= 12


def test_the_expert_alone_always_scores(alone):
    for outcomes in episodes(alone, GAMES, attacker="expert"):
        assert outcomes[-1].terminated
        assert len(outcomes) < 250


@pytest.mark.slow  # whole games; test_the_expert_alone_always_scores plays those of the attacker
def test_the_expert_defender_saves_more_than_an_idle_one(two):
    scored = {
        script: sum(
            outcomes[-1].terminated
            for outcomes in episodes(two, GAMES, attacker="expert", defender=script)
        )
        for script in ("idle", "expert")
    }
    assert scored["idle"] >= GAMES - 2
    assert scored["expert"] <= scored["idle"] - GAMES // 3


@pytest.mark.parametrize("task", ["SoccerOnePlayer", "SoccerTwoPlayer"])
@pytest.mark.parametrize("body", ["mitten", "mitten_position"])
def test_joint_level_bodies_can_play(task, body):
    game = game_of(task, f"body={body}", "senses/touch=numb", "task.max_seconds=0.4")
    roles = {player.team: "expert" for player in game.players}
    (outcomes,) = episodes(game, 1, **roles)
    assert outcomes[-1].truncated
    game.close()


@pytest.mark.slow
def test_the_expert_on_hands_and_knees_pushes_the_ball():
    game = game_of("SoccerOnePlayer", "body=mitten", "senses/touch=numb", "task.max_seconds=16.0")
    received = {"approach": 0.0, "progress": 0.0}
    for outcomes in episodes(game, 3, attacker="expert"):
        for term in received:
            received[term] += sum(outcome.terms["attacker"][term] for outcome in outcomes) / 3.0
    game.close()
    assert received["approach"] > 0.4
    assert received["progress"] > 0.05

"""PushOut1v1 and PushOut2v2: rules, rewards, symmetry of the teams and expert."""

import math

import numpy as np
import pytest
from composed import compose
from contests import episodes, game_of, rest, total_reward
from refusals import naming

OUTSIDE = (1.3, 0.0, 0.0)


@pytest.fixture(scope="module")
def duel():
    game = game_of("PushOut1v1")
    yield game
    game.close()


@pytest.fixture(scope="module")
def four():
    game = game_of("PushOut2v2")
    yield game
    game.close()


def begin(game, seed=0):
    game.reset(np.random.default_rng(seed))
    return [player.body for player in game.players]


def stand(game, *places):
    """Begin with walkers at (distance from the middle, direction, heading), metres and degrees."""
    for body, (distance_m, direction_deg, heading_deg) in zip(begin(game), places, strict=True):
        x, y = (distance_m * f(math.radians(direction_deg)) for f in (math.cos, math.sin))
        body.place((x, y, 0.0), math.radians(heading_deg))


def push(game, seconds, *rows):
    """Play constant rows; return the last outcome."""
    for _ in range(round(seconds / 0.04)):
        moves = zip(game.players, rows, strict=False)
        actions = {player.name: np.array(row, np.float32) for player, row in moves}
        outcome = game.step(actions)
        if outcome.done:
            break
    return outcome


@pytest.mark.parametrize(
    ("task", "numbers"),
    [
        ("PushOut1v1", ["task.radius_m=0.5", "task.start_share=0.3", "body=mitten"]),
        ("PushOut2v2", ["task.radius_m=0.5", "task.start_share=0.3"]),
    ],
)
def test_starts_at_which_players_overlap_are_refused(task, numbers):
    """Opponents, or two of a team; Bullet itself finds no contacts between walkers."""
    with pytest.raises(ValueError, match=naming("task.start_share=0.3", "task.radius_m=0.5")):
        game_of(task, *numbers)


def test_rewards_of_a_duel_sum_to_zero_in_every_step(duel):
    fallen = 0
    for outcomes in episodes(duel, 3, red="expert", blue="random"):
        for outcome in outcomes:
            assert total_reward(duel, outcome) == pytest.approx(0.0, abs=1e-12)
            ground = [terms["ground"] for terms in outcome.terms.values()]
            assert sum(ground) == pytest.approx(0.0, abs=1e-12)
            fallen += sum(terms["out"] < 0.0 for terms in outcome.terms.values())
        assert outcomes[-1].solved == {"red": True, "blue": False}
    assert fallen >= 3


def exits(game, *names):
    """Take players out of the ring, one after the other; return the returns of all players."""
    begin(game)
    total = dict.fromkeys((player.name for player in game.players), 0.0)
    bodies = {player.name: player.body for player in game.players}
    for name in names:
        bodies[name].place(OUTSIDE)
        (outcome,) = rest(game)
        for player, terms in outcome.terms.items():
            total[player] += game.reward_of(terms)
    return total, outcome


def test_pushing_the_own_mate_out_first_has_a_lower_return(four):
    """With rewards divided among those who remain, it doubled the rewards of the pushes."""
    fair, end = exits(four, "blue_0", "blue_1")
    assert end.solved == {"red_0": True, "red_1": True, "blue_0": False, "blue_1": False}
    alone, end = exits(four, "red_1", "blue_0", "blue_1")
    assert end.solved["red_0"]
    assert alone["red_0"] < fair["red_0"] - 0.4


def test_leaving_the_ring_early_is_not_cheaper_than_losing_late(four):
    weight = four.weights["ground"]
    for names in (("red_0", "red_1"), ("red_1", "red_0")):
        lost, _ = exits(four, *names)
        assert lost["red_0"] == pytest.approx(-1.0, abs=2.0 * weight)
    begin(four)
    outs = {"red_0": 0.0, "red_1": 0.0}
    for body in [player.body for player in four.players[:2]]:
        body.place(OUTSIDE)
        (outcome,) = rest(four)
        for name in outs:
            outs[name] += outcome.terms[name]["out"]
    assert outs == {"red_0": -1.0, "red_1": -1.0}


def test_exchanged_teams_receive_exchanged_rewards(duel):
    """The starting positions are equivalent: the same starts and actions with exchanged teams."""
    rows = np.random.default_rng(3).uniform(-0.3, 1.0, (40, 2, 2)).astype(np.float32)
    seats, received = [(0.6, 0.0, 170.0), (0.6, 180.0, 10.0)], []
    for order in ((0, 1), (1, 0)):
        stand(duel, *(seats[seat] for seat in order))
        by_seat = []
        for row in rows:
            actions = {p.name: row[seat] for p, seat in zip(duel.players, order, strict=True)}
            outcome = duel.step(actions)
            by_seat.append([outcome.terms[("red", "blue")[order.index(seat)]] for seat in (0, 1)])
        received.append([[list(terms.values()) for terms in step] for step in by_seat])
    assert np.abs(received[0]).max() > 0.01
    np.testing.assert_allclose(received[0], received[1], atol=1e-9)


@pytest.mark.slow  # the test before and the test after it: places and pushes are symmetric
def test_random_policies_win_equally_often(duel):
    """Of 60 games the red team wins 30 within 2.6 standard deviations."""
    won = sum(
        any(o.terms["red"]["push"] > 0.0 for o in outcomes)
        for outcomes in episodes(duel, 60, red="random", blue="random")
    )
    assert 20 <= won <= 40


def test_players_start_opposite_each_other_and_face_the_middle(duel):
    for seed in range(20):
        red, blue = begin(duel, seed)
        np.testing.assert_allclose(red.position[:2], -blue.position[:2], atol=1e-9)
        for body in (red, blue):
            inward = -body.position[:2] / np.hypot(*body.position[:2])
            assert np.hypot(*body.position[:2]) == pytest.approx(0.6)
            assert body.forward[:2] @ inward > math.cos(math.radians(30.1))


def test_a_player_beyond_the_rim_is_out_and_terminates_the_game(duel):
    red, _ = begin(duel)
    red.place((0.99, 0.0, 0.0))
    (inside,) = rest(duel)
    assert not inside.done
    assert inside.terms["red"]["out"] == 0.0
    red.place((1.01, 0.0, 0.0))
    (outside,) = rest(duel)
    assert outside.terminated
    assert (outside.terms["red"]["out"], outside.terms["red"]["push"]) == (-1.0, 0.0)
    assert (outside.terms["blue"]["out"], outside.terms["blue"]["push"]) == (0.0, 1.0)


def test_both_out_in_one_step_is_a_draw(duel):
    red, blue = begin(duel)
    red.place((1.3, 0.0, 0.0))
    blue.place((-1.3, 0.0, 0.0))
    (outcome,) = rest(duel)
    assert outcome.terminated
    assert outcome.terms["red"] == pytest.approx(outcome.terms["blue"])


def test_a_game_without_a_winner_is_truncated():
    game = game_of("PushOut1v1", "task.max_seconds=0.4")
    *_, last = rest(game, 0.4)
    assert last.truncated
    assert not last.terminated
    assert last.terms["red"]["push"] == last.terms["blue"]["push"] == 0.0
    game.close()


def test_ground_is_a_difference_of_potentials(duel):
    stand(duel, (0.6, 0.0, 180.0), (0.6, 180.0, 0.0))
    total = 0.0
    for row in ((1.0, 0.0), (-1.0, 0.2), (1.0, -0.4)):
        for _ in range(6):
            actions = {"red": np.array(row, np.float32), "blue": np.zeros(2, np.float32)}
            total += duel.step(actions).terms["red"]["ground"]
    red = duel.players[0].body.position[:2]
    assert total == pytest.approx(0.36 - float(red @ red), abs=1e-9)


def test_face_to_face_two_walkers_hold_each_other(duel):
    stand(duel, (0.12, 0.0, 180.0), (0.12, 180.0, 0.0))
    push(duel, 2.0, (1.0, 0.0), (1.0, 0.0))
    for player in duel.players:
        assert np.hypot(*player.body.position[:2]) < 0.15


def test_a_push_from_behind_moves_the_opponent_out(duel):
    stand(duel, (0.12, 180.0, 0.0), (0.3, 0.0, 0.0))
    outcome = push(duel, 3.0, (1.0, 0.0), (0.0, 0.0))
    assert outcome.terminated
    assert outcome.terms["red"]["push"] == 1.0


def test_the_expert_pushes_out_an_idle_opponent(duel):
    for outcomes in episodes(duel, 10, red="idle", blue="expert"):
        assert outcomes[-1].terms["blue"]["push"] == 1.0
        assert len(outcomes) < 150


def test_an_eliminated_player_stays_out_while_its_teammate_continues(four):
    red_0, red_1, *_ = begin(four)
    home = red_0.position
    red_0.place(OUTSIDE)
    (first,) = rest(four)
    assert not first.done
    assert first.eliminated == {"red_0"}
    assert first.terms["red_0"]["out"] == -1.0
    assert first.terms["red_1"]["out"] == -0.5
    assert first.terms["blue_0"]["push"] == first.terms["blue_1"]["push"] == 0.5
    red_0.place(home)
    (second,) = rest(four)
    assert second.eliminated == {"red_0"}
    assert set(second.terms["red_0"].values()) == {0.0}
    assert second.terms["blue_0"]["push"] == 0.0
    red_1.place(OUTSIDE)
    (third,) = rest(four)
    assert third.terminated
    assert third.terms["blue_0"]["push"] == 0.5


def test_a_remaining_player_receives_the_reward_of_the_team(four):
    _, _, blue_0, blue_1 = begin(four)
    blue_0.place(OUTSIDE)
    rest(four)
    blue_1.place(OUTSIDE)
    (last,) = rest(four)
    assert last.terminated
    assert last.terms["red_0"]["push"] == 0.5
    assert last.terms["blue_1"]["out"] == -0.5


def test_the_painted_ring_has_no_collision(duel):
    red, _ = begin(duel)
    for x in np.linspace(0.5, 1.5, 21):
        red.place((x, 0.0, 0.0))
        assert red.position[0] == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_joint_level_bodies_can_play(task):
    game = game_of(task, "body=mitten_position", "task.max_seconds=0.6")
    for script in ("random", "expert"):
        (outcomes,) = episodes(game, 1, red=script, blue="random")
        assert outcomes[-1].truncated
        for outcome in outcomes:
            assert total_reward(game, outcome) == pytest.approx(0.0, abs=1e-12)
    game.close()


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_shirts_have_the_colours_of_the_teams(task):
    """Count red and blue pixels in the image of each player, which faces an opponent."""
    game = game_of(task, "senses/vision=monocular")
    rest(game)
    for player in game.players:
        red, green, blue = game.observe(player)["vision"].astype(int).reshape(3, -1)
        reds = ((red > 2 * blue) & (red > 2 * green)).sum()
        blues = ((blue > 2 * red) & (blue > green + 40)).sum()
        seen, other = (blues, reds) if player.team == "red" else (reds, blues)
        assert seen > 20, player.name
        assert other < 20 or task == "PushOut2v2", player.name  # where mates are in view as well
    game.close()


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_furniture_in_the_ring_is_refused_by_name(task):
    """A player that backs against it could not be pushed out."""
    parts = ("'single_room'", "task.radius_m=2.5", "'bed'", "2.05 m", "'room'", "playground=simple")
    with pytest.raises(ValueError, match=naming(*parts)):
        compose([f"+task={task}", "playground=single_room", "task.radius_m=2.5"])
    compose([f"+task={task}", "playground=single_room", "task.radius_m=2.0"])
    compose([f"+task={task}", "task.radius_m=2.5"])

"""PushOut1v1 and PushOut2v2: who is out, what that pays, and that no seat is the better one."""

import math

import numpy as np
import pytest
from contests import episodes, game_of, paid_in_all, rest

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


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_what_one_team_gets_the_other_loses_at_every_step(task):
    game, fallen = game_of(task), 0
    for outcomes in episodes(game, 3, red="expert", blue="random"):
        for outcome in outcomes:
            assert paid_in_all(game, outcome) == pytest.approx(0.0, abs=1e-12)
            ground = [terms["ground"] for terms in outcome.terms.values()]
            assert sum(ground) == pytest.approx(0.0, abs=1e-12)
            fallen += sum(terms["out"] < 0.0 for terms in outcome.terms.values())
    assert fallen >= 3
    game.close()


def test_swapped_teams_are_paid_swapped(duel):
    """The seats differ in nothing: the same starts and rows with the colours changed."""
    rows = np.random.default_rng(3).uniform(-0.3, 1.0, (40, 2, 2)).astype(np.float32)
    seats, paid = [(0.6, 0.0, 170.0), (0.6, 180.0, 10.0)], []
    for order in ((0, 1), (1, 0)):
        stand(duel, *(seats[seat] for seat in order))
        told = []
        for row in rows:
            actions = {p.name: row[seat] for p, seat in zip(duel.players, order, strict=True)}
            outcome = duel.step(actions)
            told.append([outcome.terms[("red", "blue")[order.index(seat)]] for seat in (0, 1)])
        paid.append([[list(terms.values()) for terms in step] for step in told])
    assert np.abs(paid[0]).max() > 0.01
    np.testing.assert_allclose(paid[0], paid[1], atol=1e-9)


def test_chance_favours_nobody(duel):
    """Of 60 games the red team wins 30, give or take 2.6 standard deviations."""
    won = sum(
        any(o.terms["red"]["push"] > 0.0 for o in outcomes)
        for outcomes in episodes(duel, 60, red="random", blue="random")
    )
    assert 20 <= won <= 40


def test_they_start_opposite_inside_the_ring_and_face_the_middle(duel):
    for seed in range(20):
        red, blue = begin(duel, seed)
        np.testing.assert_allclose(red.position[:2], -blue.position[:2], atol=1e-9)
        for body in (red, blue):
            inward = -body.position[:2] / np.hypot(*body.position[:2])
            assert np.hypot(*body.position[:2]) == pytest.approx(0.6)
            assert body.forward[:2] @ inward > math.cos(math.radians(30.1))


def test_who_is_beyond_the_rim_is_out_and_that_ends_the_game(duel):
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


def test_when_the_time_is_up_nobody_has_won():
    game = game_of("PushOut1v1", "task.max_seconds=0.4")
    *_, last = rest(game, 0.4)
    assert last.truncated
    assert not last.terminated
    assert last.terms["red"]["push"] == last.terms["blue"]["push"] == 0.0
    game.close()


def test_ground_pays_for_places_not_for_the_way(duel):
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


def test_who_pushes_from_behind_shoves_the_other_out(duel):
    stand(duel, (0.12, 180.0, 0.0), (0.3, 0.0, 0.0))
    outcome = push(duel, 3.0, (1.0, 0.0), (0.0, 0.0))
    assert outcome.terminated
    assert outcome.terms["red"]["push"] == 1.0


def test_the_expert_pushes_out_who_stands_still(duel):
    for outcomes in episodes(duel, 10, red="idle", blue="expert"):
        assert outcomes[-1].terms["blue"]["push"] == 1.0
        assert len(outcomes) < 150


def test_who_is_out_stays_out_while_its_mate_plays_on(four):
    red_0, red_1, *_ = begin(four)
    home = red_0.position
    red_0.place(OUTSIDE)
    (first,) = rest(four)
    assert not first.done
    assert first.eliminated == {"red_0"}
    assert first.terms["red_0"]["out"] == -1.0
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


def test_who_is_alone_is_paid_for_two(four):
    _, _, blue_0, blue_1 = begin(four)
    blue_0.place(OUTSIDE)
    rest(four)
    blue_1.place(OUTSIDE)
    (last,) = rest(four)
    assert last.terminated
    assert last.terms["red_0"]["push"] == 0.5
    assert last.terms["blue_1"]["out"] == -1.0


def test_the_ring_is_seen_and_not_felt(duel):
    red, _ = begin(duel)
    for x in np.linspace(0.5, 1.5, 21):
        red.place((x, 0.0, 0.0))
        assert red.position[0] == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_joint_level_bodies_play_by_the_same_rules(task):
    game = game_of(task, "body=mitten_position", "task.max_seconds=0.6")
    for script in ("random", "expert"):
        (outcomes,) = episodes(game, 1, red=script, blue="random")
        assert outcomes[-1].truncated
        for outcome in outcomes:
            assert paid_in_all(game, outcome) == pytest.approx(0.0, abs=1e-12)
    game.close()


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("task.radius_m=3.5", "does not fit into the room 'room'"),
        ("task.radius_m=0.2", "at least 0.5"),
        ("task.start_share=1.0", r"\[0.3, 0.9\]"),
        ("task.spread_deg=200", r"\[0, 180\]"),
    ],
)
def test_what_is_impossible_is_refused(override, words):
    with pytest.raises(ValueError, match=words):
        game_of("PushOut1v1", override)


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_teams_wear_what_they_are_called(task):
    """Each player sees an opponent before it: how red and how blue are the pixels of its shirt?"""
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

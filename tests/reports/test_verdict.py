"""Verdicts on claims."""

import pytest
from refusals import naming

from veca_marl.config.experiment import (
    Above,
    AboveNumber,
    AboveTimes,
    Equal,
    Faster,
    RunsAbove,
    parse_claim,
)
from veca_marl.reports.scores import ExpertScore, Point, Run
from veca_marl.reports.verdict import Evidence, Judgement, Verdict, judge, overall


def runs(arm, scores, random=0.0, ended=True):
    return [
        Run(arm, seed, ended, (Point(100, 1.0, 2.0, score, 32),), random)
        for seed, score in enumerate(scores)
    ]


def evidence(planned=3, expert=None, **scores):
    by_arm = {arm: runs(arm, values) for arm, values in scores.items()}
    return Evidence(by_arm, planned, expert)


def verdict(text, given):
    return judge(parse_claim(text, given.runs), given).verdict


@pytest.mark.parametrize(
    ("text", "claim"),
    [
        ("a > b", Above("a", "b")),
        ("a > random", Above("a", "random")),
        ("a  >  -1.5", AboveNumber("a", -1.5)),
        ("9 runs of a > 6", RunsAbove(9, "a", 6.0)),
        ("a = b +- 0.5", Equal("a", "b", 0.5)),
        ("a > 1.25 x b", AboveTimes("a", 1.25, "b")),
        ("a faster than b", Faster("a", "b")),
    ],
)
def test_a_line_of_text_is_a_claim(text, claim):
    assert parse_claim(text, ["a", "b"]) == claim


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a >> b", ("'a >> b'", "'ARM > ARM'")),
        ("a > c", ("'a > c'", "'c'", "a, b")),
        ("random > a", ("'random > a'", "'random'")),
        ("a = b +- 0", ("'a = b +- 0'", "0.0")),
        ("2 runs of c > 1", ("'2 runs of c > 1'", "'c'")),
        ("a > -1 x b", ("'a > -1 x b'", "-1.0")),
        ("a faster than random", ("'a faster than random'", "'random'")),
        ("a faster b", ("'a faster b'", "'ARM faster than ARM'")),
    ],
)
def test_other_text_is_refused(text, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        parse_claim(text, ["a", "b"])


def test_arms_with_disjoint_scores_are_ordered():
    given = evidence(a=[6.0, 6.5, 7.0], b=[0.0, 0.5, 0.3])
    assert verdict("a > b", given) is Verdict.holds
    assert verdict("b > a", given) is Verdict.does_not_hold
    judgement = judge(parse_claim("a > b", given.runs), given)
    assert "probability of improvement 1.00 [1.00, 1.00], 3 and 3 runs" in judgement.reason


def test_equal_and_overlapping_arms_are_undecided():
    assert verdict("a > b", evidence(a=[1.0, 1.0, 1.0], b=[1.0, 1.0, 1.0])) is Verdict.undecided
    assert verdict("a > b", evidence(a=[1.0, 2.0, 9.0], b=[1.5, 2.5, 3.0])) is Verdict.undecided


def test_two_runs_are_too_few():
    given = evidence(a=[6.0, 7.0], b=[0.0, 1.0, 2.0])
    assert judge(parse_claim("a > b", given.runs), given) == Judgement(
        Verdict.undecided, "2 and 3 ended runs; 3 of an arm are needed"
    )


def test_runs_that_have_not_ended_do_not_count():
    given = Evidence({"a": [*runs("a", [6, 7]), *runs("a", [8], ended=False)]}, 3)
    assert judge(AboveNumber("a", 1.0), given) == Judgement(
        Verdict.undecided, "2 ended runs; 3 of an arm are needed"
    )


def test_an_arm_is_compared_with_random_actions_in_its_own_runs():
    assert verdict("a > random", evidence(a=[1.0, 1.5, 2.0])) is Verdict.holds
    assert verdict("a > random", evidence(a=[-1.0, -1.5, -2.0])) is Verdict.does_not_hold


@pytest.mark.parametrize(
    ("scores", "expert", "expected"),
    [
        ([8.0, 9.0, 9.5], ExpertScore(7.4, (7.2, 7.6)), Verdict.holds),
        ([6.0, 6.5, 7.0], ExpertScore(7.4, (7.2, 7.6)), Verdict.does_not_hold),
        # with few episodes of the expert nothing is decided
        ([8.0, 9.0, 9.5], ExpertScore(7.4, (5.0, 9.8)), Verdict.undecided),
        ([8.0, 9.0, 9.5], ExpertScore(7.4), Verdict.undecided),
        ([8.0, 9.0, 9.5], None, Verdict.undecided),
    ],
)
def test_the_score_of_the_expert_has_an_interval_and_may_be_missing(scores, expert, expected):
    assert verdict("a > expert", evidence(a=scores, expert=expert)) is expected


@pytest.mark.parametrize(
    ("scores", "expected"),
    [
        ([7] * 9 + [1], Verdict.holds),
        ([7] * 8 + [1] * 2, Verdict.does_not_hold),
        ([7] * 8 + [1], Verdict.undecided),  # one run is missing
        ([7] * 7 + [1] * 2, Verdict.does_not_hold),  # the missing one cannot save it
        ([6.0] * 10, Verdict.does_not_hold),  # at 6 is not above 6
    ],
)
def test_runs_above_a_number_are_counted(scores, expected):
    assert verdict("9 runs of a > 6", evidence(10, a=scores)) is expected


@pytest.mark.parametrize(
    ("margin", "expected"),
    [("5.0", Verdict.holds), ("1.0", Verdict.does_not_hold), ("3.0", Verdict.undecided)],
)
def test_equality_is_judged_by_the_margin(margin, expected):
    given = evidence(a=[4.0, 5.0, 6.0], b=[1.0, 2.0, 3.0])
    assert verdict(f"a = b +- {margin}", given) is expected


def test_all_claims_have_to_hold_together():
    holds, fails, open_ = (
        Judgement(verdict, "")
        for verdict in (Verdict.holds, Verdict.does_not_hold, Verdict.undecided)
    )
    assert overall([holds, holds]) is Verdict.holds
    assert overall([holds, open_]) is Verdict.undecided
    assert overall([holds, open_, fails]) is Verdict.does_not_hold
    assert overall([]) is Verdict.undecided


def test_an_arm_is_compared_with_a_multiple_of_another():
    given = evidence(a=[6.0, 6.5, 7.0], b=[5.0, 5.1, 5.2])
    assert verdict("a > 1.1 x b", given) is Verdict.holds
    assert verdict("a > 1.25 x b", given) is Verdict.undecided
    assert verdict("a > 1.5 x b", given) is Verdict.does_not_hold


def reaching(arm, frames):
    """Return runs with 4.0 at first, and 6.0 after so many frames; None: never."""
    return [Run(arm, seed, True, points_of(first), 0.0) for seed, first in enumerate(frames)]


def points_of(first):
    scores = {at: 6.0 if first and at >= first else 4.0 for at in range(100, 1000, 100)}
    return tuple(Point(at, 1.0, 2.0, score, 32) for at, score in scores.items())


def faster(a, b, threshold=5.0):
    given = Evidence({"a": reaching("a", a), "b": reaching("b", b)}, 3, threshold=threshold)
    return judge(Faster("a", "b"), given)


def test_an_arm_is_faster_that_needs_fewer_frames_to_the_threshold():
    assert faster([100, 200, 300], [400, 500, 600]).verdict is Verdict.holds
    assert faster([400, 500, 600], [100, 200, 300]).verdict is Verdict.does_not_hold
    assert faster([100, 400, 700], [200, 400, 600]).verdict is Verdict.undecided


def test_a_run_that_does_not_reach_the_threshold_is_slower_than_each_that_does():
    assert faster([900, 900, 900], [None, None, None]).verdict is Verdict.holds
    judgement = faster([None, None, None], [None, None, None])
    assert judgement.verdict is Verdict.undecided
    assert "probability of fewer frames to 5 0.50 [0.50, 0.50]" in judgement.reason


def runs_at(arm, *scores):
    """Return three equal runs of an arm with these scores by frames."""
    points = tuple(Point(at, 1.0, 2.0, score, 32) for at, score in scores)
    return [Run(arm, seed, True, points, 0.0) for seed in range(3)]


def test_a_run_with_fewer_frames_is_not_slower_than_one_that_reached_the_threshold_after_them():
    short, long = runs_at("a", (100, 3.0)), runs_at("b", (100, 2.0), (200, 6.0))
    for given in ({"a": short, "b": long}, {"a": long, "b": short}):
        judgement = judge(Faster("a", "b"), Evidence(given, 3, threshold=5.0))
        assert judgement.verdict is Verdict.undecided
        assert "0.50 [0.50, 0.50] within 100" in judgement.reason


def test_runs_that_were_evaluated_at_different_frames_are_not_compared():
    often = runs_at("a", (20, 2.0), (40, 6.0), (60, 6.0))
    seldom = runs_at("b", (60, 6.0))
    judgement = judge(Faster("a", "b"), Evidence({"a": often, "b": seldom}, 3, threshold=5.0))
    assert judgement == Judgement(Verdict.undecided, "the runs were evaluated at different frames")


def test_without_a_threshold_no_arm_is_faster():
    assert faster([100] * 3, [900] * 3, threshold=None) == Judgement(
        Verdict.undecided, "the experiment has no threshold"
    )

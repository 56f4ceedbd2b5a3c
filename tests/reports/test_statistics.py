"""Statistics over runs, against the definitions of Agarwal et al. 2021."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from refusals import naming
from scipy import stats

from veca_marl.reports.statistics import (
    bootstrap_interval,
    difference,
    interquartile_mean,
    interval_of_difference,
    probability_of_improvement,
)

GOLDEN = json.loads((Path(__file__).parent / "rliable.json").read_text())


def test_the_interval_of_a_difference_combines_those_of_both():
    low, high = interval_of_difference(5.0, (4.0, 6.5), 3.0, (2.0, 4.0))
    assert low == pytest.approx(2.0 - math.hypot(1.0, 1.0))
    assert high == pytest.approx(2.0 + math.hypot(1.5, 1.0))
    assert interval_of_difference(5.0, (4.0, 6.5), 3.0, (3.0, 3.0)) == (1.0, 3.5)


def column(*values):
    return np.array(values, float)[:, None]


def test_the_interquartile_mean_is_the_mean_of_the_middle_half():
    assert interquartile_mean(column(100, 1, 2, 3, 4, 5, 6, -50)) == pytest.approx(3.5)
    assert interquartile_mean(np.array([[0.0, 10.0], [1.0, 2.0]])) == pytest.approx(1.5)
    assert interquartile_mean(column(1, 2, 9)) == pytest.approx(4.0)  # too few to leave any out
    assert interquartile_mean(column(7)) == 7.0


def test_every_pair_of_runs_is_compared_and_equal_ones_count_one_half():
    one, other = column(1, 2, 3), column(2, 0)
    # 1>0, 2=2, 2>0, 3>2, 3>0 of six pairs
    assert probability_of_improvement(one, other) == pytest.approx(4.5 / 6)
    assert probability_of_improvement(other, one) == pytest.approx(1.5 / 6)
    assert probability_of_improvement(one, one) == 0.5
    assert probability_of_improvement(column(1, 1), column(1)) == 0.5
    assert probability_of_improvement(column(5, 6), column(1, 2, 3)) == 1.0


def test_improvement_is_the_statistic_of_mann_and_whitney_averaged_over_tasks():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(5, 3)), rng.normal(size=(7, 3))
    expected = np.mean([stats.mannwhitneyu(one[:, t], other[:, t])[0] / 35 for t in range(3)])
    assert probability_of_improvement(one, other) == pytest.approx(expected)


def test_arms_on_different_numbers_of_tasks_cannot_be_compared():
    with pytest.raises(ValueError, match=naming("1 ", " 2 ", "tasks")):
        probability_of_improvement(column(1, 2), np.ones((2, 2)))


def test_equal_scores_have_an_interval_without_width():
    rng = np.random.default_rng(0)
    assert bootstrap_interval(interquartile_mean, [column(3, 3, 3)], rng, 50) == (3.0, 3.0)


def test_one_run_has_no_interval():
    interval = bootstrap_interval(interquartile_mean, [column(3)], np.random.default_rng(0))
    assert all(map(math.isnan, interval))


def test_the_bootstrap_of_two_runs_has_their_three_means():
    """A resample of two runs has the mean of one, of the other, or of both."""
    seen = set()

    def remember(scores):
        seen.update(interquartile_mean(scores))
        return interquartile_mean(scores)

    low, high = bootstrap_interval(remember, [column(0, 4)], np.random.default_rng(0), 200)
    assert seen == {0.0, 2.0, 4.0}
    assert (low, high) == (0.0, 4.0)


def test_runs_are_drawn_within_their_task():
    """Scores of a task stay in its column, whatever is drawn."""

    def check(scores):
        assert set(scores[..., 0].flat) == {0.0, 1.0}
        assert set(scores[..., 1].flat) == {10.0, 11.0}
        return interquartile_mean(scores)

    scores = np.array([[0.0, 10.0], [1.0, 11.0]])
    bootstrap_interval(check, [scores], np.random.default_rng(0), 100)


def test_the_interval_of_a_mean_approaches_that_of_the_normal_distribution():
    scores = np.random.default_rng(1).normal(5.0, 2.0, (400, 1))
    rng = np.random.default_rng(2)
    low, high = bootstrap_interval(lambda s: s.mean(axis=(-2, -1)), [scores], rng)
    half = 1.96 * scores.std() / 20.0
    assert low == pytest.approx(scores.mean() - half, abs=0.03)
    assert high == pytest.approx(scores.mean() + half, abs=0.03)


def test_equal_generators_give_equal_intervals():
    arms = [column(1, 2, 5, 6), column(0, 1, 1)]
    first, second = (
        bootstrap_interval(difference, arms, np.random.default_rng(7), 300) for _ in range(2)
    )
    assert first == second
    assert first[0] < difference(*arms) < first[1]


@pytest.mark.parametrize("case", GOLDEN, ids=lambda case: case["name"])
def test_statistics_agree_with_rliable(case):
    one, other = np.array(case["one"]), np.array(case["other"])
    assert interquartile_mean(one) == pytest.approx(case["iqm"])
    assert probability_of_improvement(one, other) == pytest.approx(case["improvement"])
    rng = np.random.default_rng(0)
    width = case["iqm_interval"][1] - case["iqm_interval"][0]
    interval = bootstrap_interval(interquartile_mean, [one], rng)
    assert interval == pytest.approx(case["iqm_interval"], abs=0.1 * width + 1e-9)
    both = bootstrap_interval(probability_of_improvement, [one, other], rng)
    step = 1.0 / (len(one) * len(other))  # of the probability: the ends lie on one of its values
    assert both == pytest.approx(case["improvement_interval"], abs=0.04 + step)

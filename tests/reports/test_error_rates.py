"""Rates of wrong decisions between arms that do not differ."""

import numpy as np
import pytest

from veca_marl.reports.statistics import (
    bootstrap_interval,
    false_order_rate,
    false_speed_rate,
    probability_of_improvement,
)


def test_few_runs_are_told_apart_more_often_than_the_confidence_says():
    """0.2 with three runs: 3 ** 3 resamples have too little spread."""
    assert 0.16 < false_order_rate(3, 3) < 0.26


@pytest.mark.slow
def test_the_rate_of_many_runs_is_that_of_the_confidence():
    assert 0.03 < false_order_rate(12, 12) < 0.08


@pytest.mark.slow
def test_the_rate_is_the_same_each_time_and_does_not_depend_on_the_order():
    first = false_order_rate(3, 5)
    false_order_rate.cache_clear()
    assert false_order_rate(3, 5) == first
    assert false_order_rate(5, 3) == pytest.approx(first, abs=0.05)


@pytest.mark.slow
def test_speeds_are_told_apart_by_chance_more_often_than_the_confidence_says_too():
    assert 0.14 < false_speed_rate(3, 3) < 0.24


@pytest.mark.slow
def test_runs_that_reach_the_threshold_at_the_same_evaluation_are_part_of_the_rate():
    """Four and four runs, which are evaluated three times each."""
    rng, decided, trials = np.random.default_rng(1), 0, 1500
    for _ in range(trials):
        arms = [rng.integers(3, size=(4, 1)).astype(float) for _ in range(2)]
        low, high = bootstrap_interval(probability_of_improvement, arms, rng, 400)
        decided += low > 0.5 or high < 0.5
    assert 0.05 < decided / trials < false_speed_rate(4, 4) + 0.03

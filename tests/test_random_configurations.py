"""Random configurations are refused in one line or played with finite values."""

import random
import signal

import pytest
from random_configurations import draw, refusal

LONGEST_S = 120


@pytest.fixture
def time_limit():
    """Interrupt a configuration that takes too long; those that play take a few seconds."""

    def stop(*_):
        raise TimeoutError(f"more than {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    yield lambda: signal.alarm(LONGEST_S)
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def try_configurations(numbers, time_limit):
    """Return how many of the configurations were refused."""
    refused = 0
    for number in numbers:
        overrides = draw(random.Random(number))
        time_limit()
        try:
            refused += refusal(overrides, number) is not None
        except Exception as error:
            error.add_note(f"configuration {number}: {' '.join(overrides)}")
            raise
    return refused


def test_some_random_configurations(time_limit):
    try_configurations(range(6), time_limit)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_random_configurations(part, time_limit):
    refused = try_configurations(range(100 * part, 100 * part + 100), time_limit)
    assert 40 < refused < 95

"""Random configurations are refused in one line or played with finite values."""

import random
import signal

import pytest
from random_configurations import draw, draw_changes, refusal, refusal_of_changes

from veca_marl.config import compose_node

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


def test_some_random_changes_of_a_composed_configuration(time_limit):
    presets = ["+task=KickTheBall", "playground=house", "senses/touch=parts"]
    node, rng = compose_node(presets), random.Random(0)
    for number in range(30):
        changes = draw_changes(rng, presets)
        time_limit()
        try:
            refusal_of_changes(node, changes, number)
        except Exception as error:
            error.add_note(f"change {number}: {' '.join(changes)}")
            raise


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_random_configurations(part, time_limit):
    refused = try_configurations(range(100 * part, 100 * part + 100), time_limit)
    assert 40 < refused < 95

"""Random configurations are refused in one line or played with finite values."""

import random
import signal

import pytest
from random_configurations import draw, draw_changes, refusal, refusal_of_changes
from refusals import naming

from veca_marl.config import ConfigError, compose_node
from veca_marl.envs.tasks.floors.outlines import start_outline
from veca_marl.sim.body.walker import WalkerCfg

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


FOUND = [
    (["+task=TurnBaby"], ["playground.walls={a:1}"]),
    (["+task=KickTheBall"], ["senses.audio.sofa_path=1e308"]),
    (["+task=GrabObject"], ["task.turn_deg=1e308"]),
    (["+task=MoveToTarget"], ["task.aside_m=-0.0"]),
    (["+task=KickTheBall"], ["task.pause_s=1e308", "task.pause_s=1e9"]),
    (["+task=ChaseCar"], ["task.choices=1e9"]),
]
"""What soaks have found, each refused in one line now."""


@pytest.mark.parametrize(("presets", "changes"), FOUND, ids=lambda words: words[0])
def test_what_soaks_have_found_is_refused(presets, changes, time_limit):
    node = compose_node(presets)
    for change in changes:
        time_limit()
        assert refusal_of_changes(node, [change], 0) is not None
        assert refusal([*presets, change], 0) is not None


def test_values_below_a_group_that_is_null_are_refused_with_both_words():
    words = ["+task=PushOut2v2", "senses.touch=null", "senses.touch.receptive_field={a:1}"]
    with pytest.raises(ConfigError, match=naming("senses.touch=null", "receptive_field")):
        compose_node(words)


def test_a_very_high_capsule_needs_little_memory():
    assert len(start_outline(WalkerCfg(capsule_height_m=1e9))) < 10_000


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_random_configurations(part, time_limit):
    refused = try_configurations(range(100 * part, 100 * part + 100), time_limit)
    assert 40 < refused < 95

"""Frozen episodes: their files, and which games are refused."""

import json
from dataclasses import replace

import pytest
from composed import compose
from refusals import naming

from veca_marl.envs.core.benchmark import find_benchmark, from_text, read_starts, to_text

QUIET = ("senses/vision=blind",)


@pytest.mark.golden
def test_an_episode_has_its_start_whatever_was_played_before():
    cfg = compose(["+task=KickTheBall", *QUIET]).game
    benchmark = find_benchmark("KickTheBall")
    found = read_starts(cfg, 20260, [3, 1])
    benchmark.check_starts(found[:1], first=3)
    benchmark.check_starts(found[1:], first=1)


def test_the_text_of_a_file_is_read_as_it_was_written():
    benchmark = find_benchmark("ColorSort")
    text = to_text(benchmark)
    assert from_text(text) == benchmark
    stored = json.loads(text)
    assert not set(stored["constant"]) & set(stored["starts"][0])
    assert set(stored["constant"]) | set(stored["starts"][0]) == set(benchmark.starts[0])
    one = replace(benchmark, starts=benchmark.starts[:1])
    assert from_text(to_text(one)) == one


@pytest.mark.golden
def test_other_senses_are_accepted():
    cfg = compose(["+task=KickTheBall", "senses/audio=mono", *QUIET]).game
    find_benchmark("KickTheBall").check(cfg)


@pytest.mark.parametrize(
    ("overrides", "parts"),
    [
        (["task.max_seconds=3"], ("KickTheBall", "version 2", "task.max_seconds=3.0", "20.0")),
        (["playground=two_rooms"], ("KickTheBall", "version 2", "100 starts", "episode 0 ")),
    ],
)
def test_other_parameters_and_playgrounds_are_refused(overrides, parts):
    cfg = compose(["+task=KickTheBall", *QUIET, *overrides]).game
    with pytest.raises(ValueError, match=naming(*parts)):
        find_benchmark("KickTheBall").check(cfg)


def test_the_first_start_that_differs_is_named():
    benchmark = find_benchmark("KickTheBall")
    moved = {**benchmark.starts[8], "ball/position": (0.0, 0.0, 0.15)}
    named = naming("KickTheBall", " 1 ", "2 starts", "episode 8 ", "ball/position", "0, 0, ")
    with pytest.raises(ValueError, match=named):
        benchmark.check_starts([benchmark.starts[7], moved], first=7)


def test_a_task_without_frozen_episodes_is_refused():
    with pytest.raises(ValueError, match=naming("'Chess'", "episodes")):
        find_benchmark("Chess")


def test_parameters_that_a_task_has_got_since_have_their_former_values():
    quiet = ["senses/vision=blind", "senses/touch=numb"]
    benchmark = find_benchmark("MultiAgentNav")
    assert benchmark.parameters["separate_finder"] is False, "its file is older than the field"
    benchmark.check_parameters(compose(["+task=MultiAgentNav", *quiet]).game.task)
    changed = compose(["+task=MultiAgentNav", "task.separate_finder=true", *quiet]).game.task
    with pytest.raises(ValueError, match=naming("task.separate_finder=True", "False")):
        benchmark.check_parameters(changed)

"""The page of rates: its figures are the measured ones, and it names every task."""

import dataclasses
import re

import pytest
from paths import ROOT

from tools.performance.command import PerformanceOptions, main, plan_of
from tools.performance.measure import Choice, Measured, Plan, Rate, measure
from tools.performance.page import COMPARISONS, core_minutes, page
from veca_marl import list_tasks
from veca_marl.bench.learning import Learning
from veca_marl.bench.rollouts import Rollouts
from veca_marl.config import compose
from veca_marl.override_text import quoted

PAGE = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
SMALL = ("collect=one_process", "collect.worlds=2", "collect.steps=8", "threads=1")
SMALL += ("task.max_seconds=0.4", "eval.every_frames=16", "eval.episodes=1", "eval.worlds=1")


def rate(choice, scale):
    rollouts = Rollouts(
        task=choice.words[0].partition("=")[2],
        playground="simple",
        worlds=choice.worlds,
        agents=int(scale),
        agent_steps_per_s=97.0 * scale,
        agent_steps_per_reference=1.0,
        view_ms=2.0,
        views_per_agent_step=scale,
        most_views_per_agent_step=None,
        wall_agent_steps_per_s=1.0,
        ms_per_part={},
        overhead=0.1,
        build_s=0.1,
    )
    return Rate(choice, "walker", rollouts)


def made_up(first):
    """Return results in which all figures grow with `first`, and no two agree."""
    plan = plan_of(PerformanceOptions())
    tasks = tuple(
        rate(Choice((f"+task={name}",)), first + number) for number, name in enumerate(plan.tasks)
    )
    comparisons = {
        name: tuple(rate(choice, first + 3.0**number) for number, choice in enumerate(choices))
        for name, choices in plan.comparisons.items()
    }
    seconds = {"collect": first, "learn": 20.0, "evaluate": 30.0}
    learning = Learning("ppo", 2, 1.0, 1.0, 7.0 * first, 1.0, 1.0, 1.0, seconds)
    names = ("veca_marl", "processor", "python", "torch", "numba", "pybullet")
    machine = {name: f"{name} {first}" for name in names}
    machine |= {"load": first, "commit": "0123456789abcdef" * 2 + "01234567"}
    cores, steps, repeats = int(first), int(first) + 50, int(first) + 90
    learnings = {"PPO": learning, "SAC": learning}
    return Measured(machine, cores, first, steps, repeats, tasks, comparisons, learnings)


def rows_of(text):
    """Return the cells of the rows of all tables."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]


def figures(text):
    """Return the lines of the page without commands, and with a digit."""
    prose = re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    return {line for line in prose.splitlines() if re.search(r"\d", line)}


def test_every_figure_is_measured():
    both = figures(page(made_up(11.0))) & figures(page(made_up(503.0)))
    units = {line for line in both if "core-minutes per 100,000 frames" in line}
    assert both == units
    assert len(units) == 1


def test_a_row_has_the_figures_of_its_measurement():
    measured = made_up(11.0)
    rows = rows_of(page(measured))
    for one in measured.tasks:
        expected = [one.rollouts.task, "`walker`", "`simple`", str(one.rollouts.agents)]
        assert [*expected, f"{one.rollouts.agent_steps_per_s:,.0f}"] in rows
    for rates in measured.comparisons.values():
        for one in rates:
            words = f"`{' '.join(one.choice.words)}`"
            relative = one.rollouts.views_per_agent_step / rates[0].rollouts.views_per_agent_step
            row = [f"{one.rollouts.agent_steps_per_s:,.0f}", f"{relative:.2f}"]
            assert row in [cells[1:] for cells in rows if cells[0].startswith(words)]


def test_core_minutes_are_those_of_all_cores():
    assert core_minutes(1000.0, 3) == pytest.approx(3 * 100 / 60)


@pytest.mark.slow
def test_the_first_choice_of_a_comparison_is_its_reference():
    for choices in COMPARISONS.values():
        assert len(choices) > 1
        for choice in choices:
            assert compose(choice.words).task.name


def test_a_changed_checkout_is_told_from_its_commit():
    measured = made_up(11.0)
    machine = dict(measured.machine, commit=f"{measured.machine['commit']}-dirty")
    assert "dirty" in page(dataclasses.replace(measured, machine=machine))
    assert "dirty" not in page(measured)


def test_the_stored_page_is_short_and_names_one_commit():
    assert len(PAGE.split()) <= 900
    assert len(re.findall(r"\b(?=[0-9a-f]*\d)[0-9a-f]{7,40}\b", PAGE)) == 1
    assert len(re.findall("commit `", PAGE)) == 1


def test_the_stored_page_has_a_rate_for_every_task_and_algorithm():
    rows = rows_of(PAGE)
    assert [row[0] for row in rows if row[0] in list_tasks()] == list_tasks()
    rates = [row[-1] for row in rows if row[0] in list_tasks()]
    rates += [row[1] for row in rows if row[0] in ("PPO", "SAC")]
    assert len(rates) == len(list_tasks()) + 2
    assert all(float(number.replace(",", "")) > 0.0 for number in rates)


def test_the_stored_page_is_the_one_that_the_command_writes():
    """All but the figures: a text that was changed by hand, or not written anew."""

    def shape(text):
        lines = [re.sub(r"[-+]?\d[\d,.]*|\W", " ", line) for line in text.splitlines()]
        return [line.split() for line in lines if not line.startswith(" processor")]

    plain = [line for line in PAGE.splitlines() if not line.startswith("|")]
    written = [line for line in page(made_up(11.0)).splitlines() if not line.startswith("|")]
    assert shape("\n".join(plain)) == shape("\n".join(written))


@pytest.mark.slow
def test_a_small_plan_is_measured():
    kick = Choice(("+task=KickTheBall", "senses/vision=blind"), worlds=2)
    training = (*kick.words, *SMALL)
    plan = Plan(("KickTheBall",), {"worlds": (kick,)}, {"PPO": training}, 3, 1, 1)
    measured = measure(plan)
    [task] = measured.tasks
    assert (task.rollouts.task, task.body) == ("KickTheBall", "walker")
    [blind] = measured.comparisons["worlds"]
    assert blind.rollouts.worlds == 2
    assert "vision" not in blind.rollouts.ms_per_part
    assert measured.learning["PPO"].frames_per_s > 0.0
    clock = compose(["+task=KickTheBall"]).game.clock
    assert measured.step_ms == pytest.approx(1e3 / clock.control_rate_hz)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["tasks=[KickTheBal]"], "KickTheBall"),
        (["steps=0"], "steps"),
        (["senses/audio=mono"], "senses/audio=mono"),
        ([f"to={quoted(ROOT)}"], f"to={ROOT}"),
    ],
)
def test_a_wrong_choice_ends_in_one_line(words, names, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert names in error
    assert error.count("\n") == 1

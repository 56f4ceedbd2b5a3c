"""Batches and stages of a run add up to its budget."""

from io import StringIO

import pytest

from veca_marl.algos.training.schedule import ProgressDisplay, Schedule


@pytest.mark.parametrize(
    ("total", "per_stage", "per_batch", "stages"),
    [
        (100, 50, 10, [5, 5]),
        (101, 50, 10, [5, 5, 1]),
        (95, 45, 10, [5, 5]),
        (30, 1000, 10, [3]),
        (1, 1, 10, [1]),
        (205, 80, 10, [2, 6, 8, 5]),  # a short stage first, where a quarter is two batches
        (100, 70, 10, [7, 3]),
        (20, 80, 10, [2]),
        (30, 80, 10, [2, 1]),
    ],
)
def test_stages_add_up_to_the_budget(total, per_stage, per_batch, stages):
    schedule = Schedule.of(total, per_stage, per_batch)
    assert list(schedule.stages_after(0)) == stages
    assert schedule.frames == per_batch * sum(stages) >= total
    for finished in range(len(stages) + 1):
        assert list(schedule.stages_after(sum(stages[:finished]))) == stages[finished:]


def test_the_short_first_stage_ends_with_a_checkpoint_alone():
    schedule = Schedule.of(205, 80, 10)
    ends = [2, 8, 16, 21]
    assert [schedule.is_evaluated(batches) for batches in ends] == [False, True, True, True]
    assert [b for b in range(21) if not schedule.is_within_stage(b)] == [0, 2, 8, 16]


def test_there_is_no_short_stage_where_the_next_one_could_not_hold_an_episode():
    assert list(Schedule.of(160, 80, 10, batches_per_episode=6).stages_after(0)) == [2, 6, 8]
    assert list(Schedule.of(160, 80, 10, batches_per_episode=7).stages_after(0)) == [8, 8]


class Terminal(StringIO):
    def isatty(self):
        return True


def test_a_terminal_has_a_bar_and_a_file_a_line_for_each_stage():
    written = {}
    for file in (StringIO(), Terminal()):
        display = ProgressDisplay(200, 40, True, file)
        for _ in range(2):
            for _ in range(4):
                display.update(20, {"red/return": 1.25})
            display.end_stage()
        display.close()
        written[type(file)] = file.getvalue()
    first, second = written[StringIO].splitlines()
    assert "120 of 200 frames" in first
    assert "200 of 200 frames" in second
    assert "red/return=1.25" in second
    assert "\r" not in written[StringIO]
    assert "\r" in written[Terminal]
    hidden = StringIO()
    display = ProgressDisplay(200, 0, False, hidden)
    display.update(20, {})
    display.end_stage()
    display.close()
    assert hidden.getvalue() == ""


def test_a_run_beyond_its_budget_has_no_stages_left():
    assert list(Schedule.of(30, 10, 10).stages_after(4)) == []

"""Batches and stages of a run add up to its budget."""

import pytest

from veca_marl.algos.training.schedule import Schedule


@pytest.mark.parametrize(
    ("total", "per_stage", "per_batch", "stages"),
    [
        (100, 50, 10, [5, 5]),
        (101, 50, 10, [5, 5, 1]),
        (95, 45, 10, [5, 5]),
        (30, 1000, 10, [3]),
        (1, 1, 10, [1]),
    ],
)
def test_stages_add_up_to_the_budget(total, per_stage, per_batch, stages):
    schedule = Schedule.of(total, per_stage, per_batch)
    assert list(schedule.stages_after(0)) == stages
    assert schedule.frames == per_batch * sum(stages) >= total
    for finished in range(len(stages) + 1):
        assert list(schedule.stages_after(sum(stages[:finished]))) == stages[finished:]


def test_a_run_beyond_its_budget_has_no_stages_left():
    assert list(Schedule.of(30, 10, 10).stages_after(4)) == []

"""Runs with more or fewer frames than an experiment asks for."""

from dataclasses import replace

import pytest
from small_experiment import EXPERIMENT, write_all
from stored_runs import write_run

from veca_marl import report
from veca_marl.reports.arms import FrameBudget, compose_arms
from veca_marl.reports.gather import run_folder
from veca_marl.sweeps.run_state import RunState

BATCH = 1024  # of the default configuration


def write_longer(folder, config, points, **options):
    write_run(folder, {**config, "total_frames": points[-1][0]}, points, **options)


@pytest.mark.slow
def test_a_run_with_more_frames_is_compared_at_the_frames_asked_for(tmp_path, arms, run):
    write_all(tmp_path, arms, [("mono", 2)])
    points = [(100, 0.1), (200, 0.2), (200 + BATCH, 9.0)]
    write_longer(run_folder(tmp_path, "mono", 2), {**arms["mono"], "seed": 2}, points)
    status, printed, _ = run(f"runs={tmp_path}")
    page = (tmp_path / "report.md").read_text()
    remark = (
        "mono, seed 2: 1224 frames, more than the 200 asked for; its final score is that at 200"
    )
    assert status == 0
    assert remark in page
    assert remark in printed
    assert "| mono | 2 | yes | 200 | 0.20 |" in page
    assert "| mono | 3 | 0.23 [0.00, 0.50] | -0.50 | 0 of 3 | not reached |" in page
    run(f"results={tmp_path / 'results.csv'}", f"to={tmp_path / 'again'}")
    again = (tmp_path / "again" / "report.md").read_text()
    assert remark in again
    assert "| mono | 2 | yes | 200 | 0.20 |" in again


@pytest.mark.slow
def test_a_run_with_more_frames_and_no_evaluation_there_does_not_count(tmp_path, arms, run):
    write_all(tmp_path, arms, [("mono", 2)])
    points = [(100, 0.1), (200 + BATCH, 9.0)]
    write_longer(run_folder(tmp_path, "mono", 2), {**arms["mono"], "seed": 2}, points)
    _, printed, _ = run(f"runs={tmp_path}")
    page = (tmp_path / "report.md").read_text()
    remark = (
        "mono, seed 2: not counted: 1224 frames, more than the 200 asked for, and no evaluation "
        "at 200"
    )
    assert remark in page
    assert remark in printed
    assert "| mono | 2 | no | 100 | 0.10 |" in page
    assert "| mono | 2 | 0.25 " in page  # two runs count


@pytest.mark.parametrize(
    ("evaluated", "final", "remark"),
    [
        ((100,), None, ""),
        ((100, 200), 200, ""),
        ((100, 1023 + 200), 1223, ""),  # an overshoot of less than a batch
        ((200, 1224), 200, "1224 frames, more than the 200 asked for; its final score is that at"),
        ((100, 1224), None, "not counted: 1224 frames, more than the 200 asked for, and no"),
    ],
)
def test_the_final_evaluation_is_in_the_batch_that_completes_the_frames(evaluated, final, remark):
    budget = FrameBudget(200, BATCH)
    assert budget.final(evaluated) == final
    assert budget.counts(RunState.finished, evaluated) == (final is not None)
    assert budget.remark(evaluated).startswith(remark)
    assert bool(budget.remark(evaluated)) == bool(remark)


def test_a_run_that_goes_on_to_a_larger_budget_counts_at_the_asked_one():
    budget = FrameBudget(200, BATCH)
    assert budget.counts(RunState.unfinished, [100, 200, 2000])
    assert not budget.counts(RunState.unfinished, [100, 200])  # it may still write its last files
    assert budget.counts(RunState.cut, [100])
    assert not budget.counts(RunState.cut, [100, 2000])


@pytest.mark.slow
def test_each_arm_has_its_own_budget():
    words = [text for text in EXPERIMENT if text != "total_frames=200"]
    words.append("experiment.arms.stereo=['senses/audio=stereo','total_frames=300']")
    arms = {arm.name: arm.budget for arm in compose_arms(words)}
    assert arms == {name: FrameBudget(122_880, BATCH) for name in ("hrtf", "mono")} | {
        "stereo": FrameBudget(300, BATCH)
    }


@pytest.mark.slow
def test_runs_of_a_table_that_end_before_the_frames_asked_for_do_not_count(
    tmp_path, arms, composed, run, monkeypatch
):
    write_all(tmp_path, arms)
    run(f"runs={tmp_path}")
    longer = [replace(arm, plain={**arm.plain, "total_frames": 400}) for arm in composed]
    monkeypatch.setattr(report, "compose_arms", lambda overrides: longer)
    _, printed, _ = run(f"results={tmp_path / 'results.csv'}", f"to={tmp_path / 'second'}")
    assert "seeds 0, 1, 2: unfinished: 200 of 400 frames in the table of results" in printed
    assert "| hrtf | 0 | no ended run |" in (tmp_path / "second" / "report.md").read_text()

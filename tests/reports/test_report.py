"""The command `report` on small run folders."""

import copy
import csv
import shlex
from dataclasses import replace

import numpy as np
import pytest
from refusals import naming
from small_experiment import EXPERIMENT, write_all
from stored_runs import write_run

from veca_marl import report
from veca_marl.algos.files import WriteError
from veca_marl.reports import figure
from veca_marl.reports.gather import (
    Found,
    gather,
    planned_rows,
    read_rows,
    run_folder,
    training_time,
    write_rows,
)
from veca_marl.reports.page import remarks
from veca_marl.reports.scores import runs_of, team_of
from veca_marl.reports.statistics import false_order_rate
from veca_marl.sweeps.run_state import RunState


def test_complete_runs_give_verdict_table_and_figure(tmp_path, arms, run):
    write_all(tmp_path, arms)
    status, printed, _ = run(f"runs={tmp_path}")
    assert status == 0
    assert "verdict: holds" in printed
    page = (tmp_path / "report.md").read_text()
    assert "**Verdict.** Holds." in page
    assert "| hrtf | 3 | 6.50 [6.00, 7.00] | -0.50 | 3 of 3 | 200 | 0.0 |" in page
    assert "| mono | 3 | 0.23 [0.00, 0.50] | -0.50 | 0 of 3 | not reached | not reached |" in page
    assert "lines in the figure: random -0.50." in page
    assert "`hrtf > mono` holds: difference 6.27 [" in page
    assert f"decided in {100 * false_order_rate(3, 3):.0f} % (3 and 3 runs) of" in page
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_the_table_of_results_gives_the_same_report(tmp_path, arms, run):
    write_all(tmp_path / "runs", arms)
    run(f"runs={tmp_path / 'runs'}", f"to={tmp_path / 'first'}")
    first = tmp_path / "first"
    run(f"results={first / 'results.csv'}", f"to={tmp_path / 'second'}")
    for name in ("results.csv", "curves.png"):
        assert (first / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    assert "- commit abc" in lines(first)
    assert lines(first) == lines(tmp_path / "second")


def test_runs_that_a_table_of_results_lacks_are_named(tmp_path, arms, run):
    write_all(tmp_path, arms, [("mono", 2)])
    run(f"runs={tmp_path}")
    _, printed, _ = run(f"results={tmp_path / 'results.csv'}")
    assert "mono, seed 2: missing in the table of results" in printed


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        ("hrtf,0,finished,0,expert", ("cells",)),
        ("hrtf,0,fin,0,policy,agents,1.0", ("state", "'fin'", "finished")),
        ("hrtf,0,finished,1e3,policy,agents,1.0", ("frames", "'1e3'")),
        ("hrtf,0,finished,200,policy,agents,high", ("return", "'high'")),
        ("hrtf,one,finished,200,policy,agents,1.0", ("seed", "'one'")),
        (f"hrtf,0,finished,200,policy,{'a' * 2**18},1.0", ()),
        (f"hrtf,0,finished,200,policy,agents,1{'0' * 5000}x", ("return",)),
    ],
)
def test_a_damaged_row_of_a_table_of_results_is_named(tmp_path, run, row, parts):
    table = tmp_path / "results.csv"
    head, good = "arm,seed,state,frames,player,team,return", "hrtf,0,finished,0,policy,agents,1.0"
    table.write_text(f"{head}\n{good}\n{row}\n")
    status, _, errors = run(f"results={table}")
    assert status == 2
    assert len(errors.splitlines()) == 1
    assert all(part in errors for part in (str(table), *parts))
    assert len(errors) < 1000, "a damaged cell fills the screen"


def rows_of(arm, seed, *scores, episodes=32):
    """Rows of a finished run of 200 frames, evaluated at the same distances."""
    head = {"arm": arm, "seed": str(seed), "state": "finished", "player": "policy"}
    return [
        {
            **head,
            "team": "agents",
            "frames": str(200 * (n + 1) // len(scores)),
            "episodes": str(episodes),
            "return": str(score),
        }
        for n, score in enumerate(scores)
    ]


def test_a_score_that_was_not_measured_is_no_failure(tmp_path, run, arms):
    rows = [row for seed in range(3) for row in rows_of("hrtf", seed, 1.0, 6.0)]
    rows[-1]["return"] = ""
    rows += [row for seed in range(3) for row in rows_of("mono", seed, 0.0, 0.0)]
    write_rows(tmp_path / "results.csv", rows)
    _, printed, _ = run(f"results={tmp_path / 'results.csv'}")
    assert "hrtf, seed 2: `return` was not measured at the end; not counted" in printed
    assert "`hrtf > mono` undecided: 2 and 3 ended runs" in (tmp_path / "report.md").read_text()


def test_runs_with_few_episodes_at_the_end_are_named(tmp_path, run):
    rows = [
        row
        for seed in range(3)
        for row in rows_of("hrtf", seed, 6.0, episodes=8 if seed == 1 else 32)
    ]
    write_rows(tmp_path / "results.csv", rows)
    run(f"results={tmp_path / 'results.csv'}")
    page = (tmp_path / "report.md").read_text()
    assert "final evaluations of as few as 8 episodes (hrtf, seed 1); figures need" in page


def test_a_curve_over_fewer_and_fewer_runs_is_explained(tmp_path, run):
    rows = [*rows_of("hrtf", 0, 1.0, 1.0), *rows_of("hrtf", 1, 9.0, 9.0)[:1]]
    write_rows(tmp_path / "results.csv", rows)
    run(f"results={tmp_path / 'results.csv'}")
    assert "over the runs that were evaluated there" in (tmp_path / "report.md").read_text()


def test_equal_remarks_are_one_line():
    found = [
        Found(arm, seed, None, RunState.missing, False, remark)
        for arm, seed, remark in (("a", 0, "x"), ("a", 1, "x"), ("b", 0, "x"), ("b", 1, ""))
    ]
    assert remarks([*found, Found("b", 2, None, RunState.cut, True, "y")]) == [
        "a, seeds 0, 1; b, seed 0: x",
        "b, seed 2: y",
    ]


def lines(folder):
    return (folder / "report.md").read_text().splitlines()


def test_missing_unfinished_cut_and_different_runs_are_named(tmp_path, arms, run):
    """They are named with the reason; only the run that was cut by its own limit counts."""
    write_all(tmp_path, arms, [("hrtf", 0), ("hrtf", 1), ("stereo", 2), ("mono", 1)])
    unfinished = {**arms["hrtf"], "seed": 1}
    write_run(run_folder(tmp_path, "hrtf", 1), unfinished, [(100, 3.0)], ended=False)
    other = {**arms["stereo"], "seed": 2, "device": "cuda"}
    other["task"] = {**other["task"], "max_seconds": 99.0}
    write_run(run_folder(tmp_path, "stereo", 2), other, [(200, 9.0)])
    status, printed, _ = run(f"runs={tmp_path}")
    assert status == 0
    page = (tmp_path / "report.md").read_text()
    for text in (printed, page):
        assert f"hrtf, seed 0: missing: no run in {run_folder(tmp_path, 'hrtf', 0)}" in text
        assert "hrtf, seed 1: unfinished: 100 of 200 frames; shown, not counted" in text
        assert "stereo, seed 2: not counted: task.max_seconds is 99.0 in the run" in text
        assert "mono, seed 1: missing" in text
        assert "device" not in text
    assert "**Verdict.** Undecided: 1 to 2 seeds." in page
    assert "| hrtf | 1 | no | 100 | 3.00 |" in page
    with (tmp_path / "results.csv").open() as file:
        assert "9.0" not in {row["return"] for row in csv.DictReader(file)}


def test_a_run_that_its_time_limit_ended_counts_and_is_named(tmp_path, arms):
    config = {**arms["hrtf"], "max_minutes": 1.0}
    write_run(run_folder(tmp_path, "hrtf", 0), {**config, "seed": 0}, [(100, 3.0)])
    ((found,), rows) = gather(tmp_path, {"hrtf": config}, [0])
    assert found.counts
    assert found.remark == "cut by max_minutes=1.0 at 100 of 200 frames"
    assert [row["state"] for row in rows] == ["cut", "cut"]


def test_a_run_that_ended_on_a_smaller_budget_does_not_count(tmp_path, arms):
    config = {**arms["hrtf"], "total_frames": 100, "seed": 0}
    write_run(run_folder(tmp_path, "hrtf", 0), config, [(100, 3.0)])
    ((found,), _) = gather(tmp_path, {"hrtf": arms["hrtf"]}, [0])
    assert not found.counts
    assert found.remark.startswith("unfinished: 100 of 200 frames")


def test_a_run_of_an_older_network_does_not_count(tmp_path, composed):
    """Its configuration has no windows of the image encoder: they were others than the default."""
    (arm,) = [arm for arm in composed if arm.name == "hrtf"]
    config = copy.deepcopy({**arm.plain, "seed": 0})
    del config["algo"]["network"]["kernels"]  # and no config_version: version 0
    write_run(run_folder(tmp_path, "hrtf", 0), config, [(200, 3.0)])
    ((found,), rows) = gather(tmp_path, {"hrtf": arm.plain}, [0])
    assert not found.counts
    assert rows == []
    assert "algo.network.kernels is [8, 4, 3] in the run, [4, 4, 3] is asked for" in found.remark


def test_minutes_of_runs_without_times_between_batches_are_those_of_batches(tmp_path, arms):
    config = {**arms["hrtf"], "seed": 0}
    points = [(100, 1.0), (200, 2.0)]
    write_run(run_folder(tmp_path, "hrtf", 0), config, points, seconds_per_frame=0.6)
    _, rows = gather(tmp_path, {"hrtf": arms["hrtf"]}, [0])
    assert [row["minutes"] for row in rows] == ["0.000", "1.000", "2.000"]


def test_minutes_include_earlier_evaluations():
    rows = [
        {"frames": "100", "frames_per_s": "10.0", "between_s": "0", "processor_s": "30"},
        {"frames": "200", "frames_per_s": "10.0", "between_s": "50.0", "processor_s": "90"},
    ]
    spent = training_time(rows)
    assert spent.frames.tolist() == [100, 200]
    assert spent.minutes.tolist() == pytest.approx([0.0, 10 / 60, 70 / 60])
    assert spent.core_minutes.tolist() == pytest.approx([0.0, 0.5, 2.0])


def test_a_half_written_last_row_is_left_out(tmp_path, arms):
    folder = run_folder(tmp_path, "hrtf", 0)
    write_run(folder, {**arms["hrtf"], "seed": 0}, [(100, 1.0)], ended=False)
    with (folder / "evaluations.csv").open("a") as file:
        file.write("200,poli")
    _, rows = gather(tmp_path, {"hrtf": arms["hrtf"]}, [0])
    assert [row["frames"] for row in rows] == ["0", "100"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["runs=nowhere"], ("audio_ablation", "nowhere")),
        (["results=nowhere.csv"], ("results=nowhere.csv",)),
        (["expert_episodes=x"], ("expert_episodes", "'x'")),
        (["expert_episodes=-1"], ("expert_episodes", "-1")),
        (["runs=a", "results=b"], ("runs", "results")),
        (["-m", "experiment.metric=return,length"], ("folder", " to")),
        (["-m", "experiment.metric=return,length", "to=x"], ("to=x", "2")),
        (["-m", "seed=glob(*)"], ("seed=glob(*)",)),
    ],
)
def test_wrong_words_end_in_one_line(run, words, parts):
    status, _, errors = run(*words)
    assert status == 2
    assert len(errors.splitlines()) == 1
    assert all(part in errors for part in parts)


@pytest.mark.parametrize(
    ("word", "advice"),
    [("foo", "KEY=VALUE"), ("runs/sweeps", "KEY=VALUE"), ("runs/sweeps/Kick,a=b", "override")],
)
def test_a_word_without_a_key_ends_in_one_line(run, word, advice):
    status, _, errors = run(word)
    assert status == 2
    assert len(errors.splitlines()) == 1
    assert advice in errors
    assert word.partition(",")[0] in errors


def test_an_experiment_without_arms_has_no_report(capsys):
    assert report.main(["+experiment=smoke"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("arms", "+experiment=NAME"))


def test_the_metric_and_the_team_must_exist():
    rows = [{"team": "red", "player": "policy", "arm": "a", "seed": "0", "return": "1"}]
    with pytest.raises(ValueError, match=naming("experiment.team=blue", "red")):
        team_of(rows, "blue")
    with pytest.raises(ValueError, match=naming("experiment.team=None", "blue", "red")):
        team_of([*rows, {**rows[0], "team": "blue"}], None)
    assert team_of([*rows, {**rows[0], "team": "blue"}], None, {"blue": "runs/other"}) == "red"
    for metric in ("goals", "player"):
        with pytest.raises(ValueError, match=rf"experiment.metric={metric}: .* return$"):
            runs_of(rows, metric, "red", {})


def test_without_matplotlib_the_extra_is_named(tmp_path, run, monkeypatch):
    monkeypatch.setattr(figure, "find_spec", lambda name: None)
    status, _, errors = run(f"runs={tmp_path}")
    assert status == 2
    assert "pip install 'veca_marl[plot]'" in errors


def with_experiment(composed, **changes):
    """Return the arms of the same experiment with other seeds, arms or claims."""
    experiment = replace(composed[0].cfg.experiment, **changes)
    return [
        replace(arm, cfg=replace(arm.cfg, experiment=experiment))
        for arm in composed
        if arm.name in experiment.arms
    ]


@pytest.mark.slow
def test_rows_of_seeds_that_are_not_planned_are_named_and_not_counted(
    tmp_path, arms, composed, run, monkeypatch
):
    claims = ["1 runs of hrtf > 5.0"]
    fewer = with_experiment(composed, seeds=[0], claims=claims)
    write_all(tmp_path, arms)
    run(f"runs={tmp_path}")
    stored = (tmp_path / "results.csv").read_bytes()
    monkeypatch.setattr(report, "compose_arms", lambda overrides: fewer)
    status, printed, _ = run(f"results={tmp_path / 'results.csv'}")
    page = (tmp_path / "report.md").read_text()
    remark = (
        "rows of hrtf, seeds 1, 2; mono, seeds 1, 2; stereo, seeds 1, 2 are not part of this "
        "experiment as configured; not counted"
    )
    assert status == 0
    assert "1 of 1 ended runs are above 5, 0 missing" in page
    assert "| hrtf | 1 | 6.00 (one run: no interval)" in page
    assert "| hrtf | 1 | yes |" not in page
    assert remark in page
    assert remark in printed
    assert (tmp_path / "results.csv").read_bytes() == stored  # the other rows are not lost


def test_rows_of_arms_that_are_not_planned_are_named_and_not_counted(
    tmp_path, arms, composed, run, monkeypatch
):
    own = {name: [] for name in ("hrtf", "stereo")}
    fewer = with_experiment(composed, arms=own, claims=["hrtf > stereo"])
    write_all(tmp_path, arms)
    run(f"runs={tmp_path}")
    monkeypatch.setattr(report, "compose_arms", lambda overrides: fewer)
    run(f"results={tmp_path / 'results.csv'}")
    page = (tmp_path / "report.md").read_text()
    assert "rows of mono, seeds 0, 1, 2 are not part of this experiment as configured" in page
    assert "| mono |" not in page


def test_rows_of_the_expert_belong_to_their_arm_whatever_their_seed():
    expert = {"arm": "a", "seed": "7", "player": "expert"}
    rows = [expert, {**expert, "arm": "b"}, {**expert, "player": "policy"}]
    assert planned_rows(rows, ["a"], [0]) == ([expert], [("a", 7), ("b", 7)])


def test_a_table_without_rows_of_the_experiment_is_refused(
    tmp_path, arms, composed, run, monkeypatch
):
    write_all(tmp_path, arms)
    run(f"runs={tmp_path}")
    other = with_experiment(composed, seeds=[7])
    monkeypatch.setattr(report, "compose_arms", lambda overrides: other)
    status, _, errors = run(f"results={tmp_path / 'results.csv'}")
    assert status == 2
    assert all(part in errors for part in ("audio_ablation", "table"))


def rows_with_episodes(path, episodes):
    """Set the episodes of the evaluations of the policy at some frames."""
    rows = read_rows(path)
    for row in rows:
        if row["player"] == "policy" and int(row["frames"]) in episodes:
            row["episodes"] = str(episodes[int(row["frames"])])
    write_rows(path, rows)


def test_few_episodes_of_evaluations_during_a_run_are_stated(tmp_path, arms, run):
    write_all(tmp_path, arms)
    run(f"runs={tmp_path}")
    table = tmp_path / "results.csv"
    sentence = (
        "Before the final evaluations, the curves and the frames and minutes to the threshold rest "
        "on evaluations of as few as 8 episodes; figures need at least 32."
    )
    assert "as few as" not in (tmp_path / "report.md").read_text()
    rows_with_episodes(table, {100: 8})
    run(f"results={table}")
    page = (tmp_path / "report.md").read_text()
    assert sentence in page
    assert "final evaluations of" not in page
    rows_with_episodes(table, {100: 32, 200: 8})
    run(f"results={table}")
    page = (tmp_path / "report.md").read_text()
    assert "as few as" not in page
    assert "final evaluations of 8 episodes; figures need at least 32" in page


def test_times_that_were_not_logged_are_not_zero():
    spent = training_time([])
    assert np.isnan(spent.minutes).all()
    assert np.isnan(spent.core_minutes).all()


def test_a_table_that_cannot_be_rewritten_keeps_its_rows(tmp_path, monkeypatch):
    path = tmp_path / "results.csv"
    write_rows(path, [{"arm": "a"}])

    def fail(*_):
        raise OSError("the disk is gone")

    monkeypatch.setattr("veca_marl.algos.files.os.fsync", fail)
    with pytest.raises(WriteError, match="the disk is gone"):
        write_rows(path, [{"arm": "b"}])
    assert path.read_text() == "arm\na\n"


def test_the_command_of_a_report_is_that_of_a_shell(tmp_path, arms, run):
    write_all(tmp_path, arms)
    words = ['experiment.claim="a; b"', f"runs={tmp_path}"]
    assert run(*words)[0] == 0
    text = (tmp_path / "report.md").read_text()
    command = text.rpartition("Command: `")[2].partition("`")[0]
    expected = ["python", "-m", "veca_marl.train", "-m", *EXPERIMENT, words[0]]
    assert shlex.split(command) == expected

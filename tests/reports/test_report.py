"""The command `report` on small run folders."""

import csv

import pytest
from stored_runs import write_run

from veca_marl import report
from veca_marl.reports import figure
from veca_marl.reports.arms import compose_arms
from veca_marl.reports.gather import Found, gather, run_folder, training_time
from veca_marl.reports.page import remarks
from veca_marl.reports.runs import runs_of, team_of
from veca_marl.sweeps.run_state import RunState

EXPERIMENT = ["+experiment=audio_ablation", "experiment.seeds=[0,1,2]", "total_frames=200"]
# without the numbers of frames that these arms have in the file
EXPERIMENT += [f"experiment.arms.{name}=['senses/audio={name}']" for name in ("stereo", "mono")]
RETURNS = {"hrtf": (6.0, 6.5, 7.0), "stereo": (5.0, 5.5, 6.0), "mono": (0.0, 0.5, 0.2)}


@pytest.fixture(scope="module")
def composed():
    return compose_arms(EXPERIMENT)


@pytest.fixture(scope="module")
def arms(composed):
    return {arm.name: arm.plain for arm in composed}


@pytest.fixture
def run(composed, capsys, monkeypatch):
    """The command, with the experiment composed once for all tests."""
    monkeypatch.setattr(report, "compose_arms", lambda overrides: composed)

    def call(*words):
        status = report.main([*EXPERIMENT, "expert_episodes=0", *words])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


def write_all(runs, arms, leave_out=()):
    for arm, returns in RETURNS.items():
        for seed, final in enumerate(returns):
            if (arm, seed) not in leave_out:
                config = {**arms[arm], "seed": seed}
                points = [(100, final / 2), (200, final)]
                write_run(run_folder(runs, arm, seed), config, points)


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
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_the_table_of_results_gives_the_same_report(tmp_path, arms, run):
    write_all(tmp_path / "runs", arms)
    run(f"runs={tmp_path / 'runs'}", f"to={tmp_path / 'first'}")
    first = tmp_path / "first"
    run(f"results={first / 'results.csv'}", f"to={tmp_path / 'second'}")
    for name in ("results.csv", "curves.png"):
        assert (first / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    without_commit = [line for line in lines(first) if line not in ("**Remarks**", "- commit abc")]
    assert [line for line in without_commit if line] == [
        line for line in lines(tmp_path / "second") if line
    ]


def test_runs_that_a_table_of_results_lacks_are_named(tmp_path, arms, run):
    write_all(tmp_path, arms, [("mono", 2)])
    run(f"runs={tmp_path}")
    _, printed, _ = run(f"results={tmp_path / 'results.csv'}")
    assert "mono, seed 2: missing in the table of results" in printed


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
        assert "stereo, seed 2: not counted: task.max_seconds is 99.0 there and" in text
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
    ("words", "message"),
    [
        (["runs=nowhere"], "no run of audio_ablation has been evaluated: missing: no run in"),
        (["results=nowhere.csv"], "No such file or directory: 'nowhere.csv'"),
        (["expert_episodes=x"], "could not be converted to Integer"),
        (["expert_episodes=-1"], "expert_episodes must be 0 or more, got -1"),
        (["runs=a", "results=b"], "runs and results: choose one of both"),
    ],
)
def test_wrong_words_end_in_one_line(run, words, message):
    status, _, errors = run(*words)
    assert status == 2
    assert len(errors.splitlines()) == 1
    assert message in errors


def test_an_experiment_without_arms_has_no_report(capsys):
    assert report.main(["+experiment=smoke"]) == 2
    assert "no experiment with arms: add +experiment=NAME" in capsys.readouterr().err


def test_the_metric_and_the_team_must_exist():
    rows = [{"team": "red", "player": "policy", "arm": "a", "seed": "0", "return": "1"}]
    with pytest.raises(ValueError, match=r"experiment.team=blue: choices: red"):
        team_of(rows, "blue")
    with pytest.raises(ValueError, match=r"experiment.team=None: choices: blue, red"):
        team_of([*rows, {**rows[0], "team": "blue"}], None)
    with pytest.raises(ValueError, match=r"experiment.metric=goals: choices: team, player, arm"):
        runs_of(rows, "goals", "red")


def test_without_matplotlib_the_extra_is_named(tmp_path, run, monkeypatch):
    monkeypatch.setattr(figure, "find_spec", lambda name: None)
    status, _, errors = run(f"runs={tmp_path}")
    assert status == 2
    assert "pip install 'veca_marl[plot]'" in errors

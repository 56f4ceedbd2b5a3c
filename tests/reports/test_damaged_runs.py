"""Runs with damaged files are named; the others are reported."""

import pytest
from small_experiment import write_all
from stored_runs import write_run

from veca_marl.reports.gather import gather, run_folder

EVALUATIONS = "frames,player,team,episodes,return\n0,random,agents,32,-0.5\n"


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        ("config.yaml", b"task: [", "while parsing"),
        ("config.yaml", b"text", "holds no configuration"),
        ("config.yaml", b"task: {name: KickTheBall}\nseed: 1\n", "no key 'total_frames'"),
        ("config.yaml", b"\xff\xfe\xff", ""),
        ("provenance.json", b'{"commit": ', "Expecting value"),
        ("provenance.json", b"[]", "no object"),
        ("progress.json", b'{"frames": 2', "Expecting"),
        ("provenance.json", b"{}", "names neither a commit nor a version"),
        ("evaluations.csv", b"", "no column 'frames'"),
        ("evaluations.csv", b"frames,player\n0,random\n", "no column 'team'"),
        ("evaluations.csv", b"\xff\xfe\xff", "can't decode"),
        (
            "evaluations.csv",
            f"{EVALUATIONS}x,policy,agents,8,1\n".encode(),
            "row 2, column 'frames': 'x' is not a whole number",
        ),
        (
            "evaluations.csv",
            f"{EVALUATIONS}100,policy,agents,8,1.5.2\n".encode(),
            "row 2, column 'return': '1.5.2' is not a number",
        ),
        (
            "evaluations.csv",
            f"{EVALUATIONS}100,pol\n200,policy,agents,32,1\n".encode(),
            "row 2 has another number of cells than the head",
        ),
        ("metrics.csv", b"frames,frames_per_s\n100,\n", "row 1, column 'frames_per_s': ''"),
        ("metrics.csv", b"frames,frames_per_s\n" + b"1" * 2**18, "field"),
        ("evaluations.csv", f"{EVALUATIONS}-100,policy,agents,8,1\n".encode(), "'-100'"),
        ("evaluations.csv", f"{EVALUATIONS}100,policy,agents,few,1\n".encode(), "'few'"),
    ],
)
def test_a_damaged_file_is_named_with_the_reason(tmp_path, arms, file, content, reason):
    for seed in (0, 1):
        config = {**arms["hrtf"], "seed": seed}
        write_run(run_folder(tmp_path, "hrtf", seed), config, [(200, 1.0)])
    path = run_folder(tmp_path, "hrtf", 1) / file
    path.write_bytes(content)
    (sound, broken), rows = gather(tmp_path, {"hrtf": arms["hrtf"]}, [0, 1])
    assert sound.counts
    assert not broken.counts
    assert broken.remark.startswith(f"not counted, damaged: {path}")
    assert reason in broken.remark
    assert {row["seed"] for row in rows} == {"0"}


@pytest.mark.slow
@pytest.mark.parametrize("file", ["config.yaml", "provenance.json", "evaluations.csv"])
def test_the_other_runs_are_reported_beside_a_damaged_one(tmp_path, arms, run, file):
    write_all(tmp_path, arms)
    path = run_folder(tmp_path, "hrtf", 1) / file
    path.write_text('{"cut": ')
    status, printed, errors = run(f"runs={tmp_path}")
    assert status == 0, errors
    page = (tmp_path / "report.md").read_text()
    for text in (page, printed):
        assert f"hrtf, seed 1: not counted, damaged: {path}" in text
    assert "| hrtf | 2 | 6.50 [6.00, 7.00] |" in page
    assert "| hrtf | 1 | yes |" not in page
    assert "| mono | 3 |" in page


@pytest.mark.parametrize("minutes", [None, 1.0])
def test_a_run_without_evaluations_does_not_count(tmp_path, arms, minutes):
    """It was logged without csv, and has all frames or was cut by its time."""
    folder = run_folder(tmp_path, "hrtf", 0)
    asked = {**arms["hrtf"], "max_minutes": minutes}
    write_run(folder, {**asked, "seed": 0}, [(200 if minutes is None else 100, 1.0)])
    (folder / "evaluations.csv").unlink()
    ((found,), rows) = gather(tmp_path, {"hrtf": asked}, [0])
    assert (found.counts, rows) == (False, [])
    message = "not counted: it has no evaluations.csv (csv is not in its log.logger)"
    assert found.remark == message


def test_a_run_without_provenance_is_not_damaged(tmp_path, arms):
    folder = run_folder(tmp_path, "hrtf", 0)
    write_run(folder, {**arms["hrtf"], "seed": 0}, [(200, 1.0)])
    (folder / "provenance.json").unlink()
    ((found,), _) = gather(tmp_path, {"hrtf": arms["hrtf"]}, [0])
    assert found.counts
    assert found.commit == ""


def test_only_damaged_runs_end_in_one_line(tmp_path, arms, run):
    folder = run_folder(tmp_path, "hrtf", 1)
    write_run(folder, {**arms["hrtf"], "seed": 1}, [(200, 1.0)])
    (folder / "config.yaml").write_text("task: [")
    status, _, errors = run(f"runs={tmp_path}")
    assert status == 2
    assert len(errors.splitlines()) == 1
    assert all(part in errors for part in ("audio_ablation", str(folder / "config.yaml")))

"""What a sweep does for a run, by what lies in its folder."""

import json

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from refusals import naming
from stored_runs import write_run

from veca_marl.sweeps.differences import differences
from veca_marl.sweeps.plans import Action, Job, SweepError, plan
from veca_marl.sweeps.run_state import with_body_kinds
from veca_marl.sweeps.sweep import cores_of, default_jobs

CONFIG = {
    "task": {"name": "KickTheBall", "weights": {"kick": 1.0}},
    "total_frames": 200,
    "max_minutes": None,
    "device": "cpu",
    "threads": None,
    "log": {"video": True},
    "experiment": {"name": "x", "arm": "a", "claims": []},
    "seed": 0,
    "collect": {"groups": 2, "processes": None, "threads": 1, "engine": "processes"},
}


def job(folder, **changes):
    return Job("a/seed_0", folder, ["+experiment=x", "seed=0"], {**CONFIG, **changes})


def test_a_missing_run_is_started_in_its_folder(tmp_path):
    folder = tmp_path / "it's, a=folder"
    made = plan(job(folder))
    assert made.action is Action.start
    assert made.arguments[:4] == ("-m", "veca_marl.train", "+experiment=x", "seed=0")
    parsed = OverridesParser.create().parse_override(made.arguments[4])
    assert (parsed.key_or_group, parsed.value()) == ("hydra.run.dir", str(folder))


def test_a_run_that_has_ended_is_skipped(tmp_path):
    write_run(tmp_path / "run", CONFIG, [(100, 1.0), (200, 2.0)])
    assert plan(job(tmp_path / "run")).action is Action.skip


@pytest.mark.parametrize("version_0_2", [False, True])
def test_the_loggers_of_a_run_have_no_influence(tmp_path, version_0_2):
    """A run of version 0.2, without progress.json, is judged by its tables."""
    folder = tmp_path / "run"
    write_run(folder, CONFIG, [(100, 1.0), (200, 2.0)])
    if version_0_2:
        (folder / "progress.json").unlink()
    else:
        (folder / "evaluations.csv").unlink()
        (folder / "metrics.csv").unlink()
    assert plan(job(folder)).action is Action.skip
    assert plan(job(folder, total_frames=400)).action is Action.resume


def test_a_run_that_is_being_continued_has_not_ended(tmp_path):
    """comparison.txt is that of the smaller budget, the last checkpoint has all frames."""
    write_run(tmp_path / "run", {**CONFIG, "total_frames": 400}, [(200, 1.0), (400, 1.0)])
    (tmp_path / "run" / "progress.json").write_text('{"frames": 400, "ended": false}')
    assert plan(job(tmp_path / "run", total_frames=400)).action is Action.resume


@pytest.mark.parametrize("content", ["", "[]", '{"frames": 3}', '{"frames": "x", "ended": true}'])
def test_a_damaged_progress_is_named(tmp_path, content):
    write_run(tmp_path / "run", CONFIG, [(200, 1.0)])
    (tmp_path / "run" / "progress.json").write_text(content)
    with pytest.raises(SweepError, match=naming(tmp_path / "run" / "progress.json")):
        plan(job(tmp_path / "run"))


HEAD = "frames,player,team,episodes,return\n"


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("player,team,return\npolicy,agents,1.0\n", "frames"),
        (f"{HEAD}many,policy,agents,32,1.0\n", "many"),
        (f"{HEAD}200,policy,agents,32,high\n", "high"),
        (f"{HEAD}100,policy\n200,policy,agents,32,1.0\n", "row 1"),
        (f"{HEAD}200,policy,{'a' * 2**18},32,1.0\n", "limit"),
        (f"{HEAD}1{'0' * 5000},policy,agents,32,1.0\n", "frames"),
        ("\0", "frames"),
    ],
)
def test_a_damaged_table_is_named(tmp_path, content, named):
    """A run of version 0.2 is judged by it."""
    folder = tmp_path / "run"
    write_run(folder, CONFIG, [(200, 1.0)])
    (folder / "progress.json").unlink()
    (folder / "evaluations.csv").write_text(content)
    with pytest.raises(SweepError, match=naming(folder / "evaluations.csv", named)):
        plan(job(folder))


def test_a_table_that_is_too_large_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("veca_marl.stored_files._LARGEST_TABLE", 1000)
    folder = tmp_path / "run"
    write_run(folder, CONFIG, [(200, 1.0)])
    (folder / "progress.json").unlink()
    assert plan(job(folder)).action is Action.skip
    with (folder / "evaluations.csv").open("a") as table:
        table.write("200,policy,agents,32,1.0\n" * 100)
    with pytest.raises(SweepError, match=naming(folder / "evaluations.csv", "MB")):
        plan(job(folder))


def test_a_row_that_is_being_written_is_not_counted(tmp_path):
    folder = tmp_path / "run"
    write_run(folder, CONFIG, [(100, 1.0)])
    (folder / "progress.json").unlink()
    with (folder / "evaluations.csv").open("a") as table:
        table.write("200,policy")
    assert plan(job(folder)).action is Action.resume


@pytest.mark.parametrize("frames", [None, "many", float("inf")])
def test_a_damaged_budget_is_named(tmp_path, frames):
    write_run(
        tmp_path / "run", {**CONFIG, "total_frames": frames, "max_minutes": 1.0}, [(100, 1.0)]
    )
    with pytest.raises(SweepError, match=naming(tmp_path / "run" / "config.yaml", "total_frames")):
        plan(job(tmp_path / "run", max_minutes=1.0))


def test_a_run_that_was_interrupted_is_continued(tmp_path):
    write_run(tmp_path / "run", CONFIG, [(100, 1.0)], ended=False)
    made = plan(job(tmp_path / "run"))
    assert made.action is Action.resume
    resume, quiet = made.arguments[2:]
    assert resume == f"resume='{tmp_path / 'run'}'"
    assert quiet == "log.progress_bar=false"


def test_a_run_that_has_ended_is_continued_on_a_larger_budget(tmp_path):
    write_run(tmp_path / "run", CONFIG, [(200, 1.0)])
    made = plan(job(tmp_path / "run", total_frames=400, max_minutes=3.0, device="cuda"))
    assert made.action is Action.resume
    assert made.arguments[4:] == ("device=cuda", "max_minutes=3.0", "total_frames=400")


def test_a_run_within_its_time_limit_is_continued_on_a_larger_budget(tmp_path):
    write_run(tmp_path / "run", {**CONFIG, "max_minutes": 600.0}, [(200, 1.0)])
    made = plan(job(tmp_path / "run", total_frames=400, max_minutes=600.0))
    assert made.action is Action.resume
    assert made.arguments[4:] == ("total_frames=400",)


def test_a_run_that_its_time_limit_ended_is_continued_without_the_limit(tmp_path):
    write_run(tmp_path / "run", {**CONFIG, "max_minutes": 1.0}, [(100, 1.0)])
    assert plan(job(tmp_path / "run", max_minutes=1.0)).action is Action.skip
    made = plan(job(tmp_path / "run"))
    assert made.action is Action.resume
    assert made.arguments[4:] == ("max_minutes=null",)


def test_a_run_of_another_configuration_is_refused_with_the_difference(tmp_path):
    write_run(tmp_path / "run", CONFIG, [(200, 1.0)])
    other = {"name": "KickTheBall", "weights": {"kick": 2.0}}
    parts = (tmp_path / "run", "task.weights.kick", "1.0", "2.0")
    with pytest.raises(SweepError, match=naming(*parts)):
        plan(job(tmp_path / "run", task=other, seed=0))


def test_claims_outputs_and_new_keys_make_no_other_configuration(tmp_path):
    write_run(tmp_path / "run", CONFIG, [(200, 1.0)])
    changes = {"experiment": {"name": "x", "claims": ["a > 1"]}, "log": {"video": False}, "new": 1}
    assert plan(job(tmp_path / "run", **changes)).action is Action.skip


def test_a_configuration_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "config.yaml").write_text("a: [")
    with pytest.raises(SweepError, match=naming(tmp_path / "config.yaml")):
        plan(job(tmp_path))
    (tmp_path / "config.yaml").write_text("")
    with pytest.raises(SweepError, match=naming(tmp_path / "config.yaml")):
        plan(job(tmp_path))


def test_differences_are_dotted_keys_with_both_values():
    found = differences({"a": {"b": 1, "c": {}}, "d": [1]}, {"a": {"b": 2}, "d": [1], "e": 0})
    assert [(d.key, d.stored, d.asked) for d in found] == [
        ("a.b", 1, 2), ("a.c", {}, "absent"), ("e", "absent", 0),
    ]  # fmt: skip
    assert [d.of_version for d in found] == [False, True, True]


def test_what_a_run_has_decided_itself_does_not_differ():
    assert not differences({"precision": "bfloat16"}, {"precision": "auto"})
    assert differences({"precision": "auto"}, {"precision": "bfloat16"})


def test_runs_at_a_time_fill_the_cores():
    two = {**CONFIG, "collect": {**CONFIG["collect"], "processes": 2}, "threads": 1}
    actors = {**CONFIG, "collect": {**CONFIG["collect"], "engine": "ray"}}
    assert (cores_of(CONFIG), cores_of(two), cores_of({**two, "threads": 4})) == (1, 2, 4)
    assert cores_of(actors) == 2
    assert default_jobs([CONFIG] * 9, 16) == 9
    assert default_jobs([CONFIG] * 9, 4) == 4
    assert default_jobs([two] * 9, 16) == 8
    assert default_jobs([CONFIG, two], 1) == 1


@pytest.mark.parametrize("team", [None, "red"])
def test_a_run_of_another_kind_of_body_is_refused(tmp_path, team):
    """Two kinds may have the same numbers: a run stores the names of its kinds beside them."""
    path = "body" if team is None else "team.red.body"
    config = CONFIG | {"body": {"height_m": 1.0}, "team": {"red": {"body": {"height_m": 1.0}}}}
    folder = tmp_path / "run"
    write_run(folder, config, [(100, 1.0), (200, 2.0)])
    asked = job(folder, **with_body_kinds({**config}, {path: "other"}))
    assert plan(asked).action is Action.skip, "an early run, which has not stored its kinds"
    (folder / "provenance.json").write_text(json.dumps({"bodies": {path: "walker"}}))
    with pytest.raises(SweepError, match=naming(f"{path}.registered_name", "walker", "other")):
        plan(asked)
    (folder / "provenance.json").write_text(json.dumps({"bodies": {path: "other"}}))
    assert plan(asked).action is Action.skip

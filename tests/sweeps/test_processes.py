"""Several processes at a time, by small ones in place of training runs."""

import io
import os
import signal
import subprocess
import sys
import time

import pytest
from refusals import naming

from veca_marl.sweeps import sweep
from veca_marl.sweeps.plans import Action, Job, Plan, SweepError
from veca_marl.sweeps.sweep import PARENT, Progress, frames_so_far, run_all, run_sweep


def make(folder, name, code="pass", action=Action.start):
    job = Job(name, folder / name, [], {"total_frames": 100, "max_minutes": None})
    return Plan(job, action, ("-S", "-c", code))


def run(plans, at_once=2):
    out = io.StringIO()
    share = {"OMP_NUM_THREADS": "1"}
    progress = Progress(100 * len(plans), len(plans), out)
    return run_all(plans, at_once, share, progress), out.getvalue()


def test_a_process_that_fails_does_not_stop_the_others(tmp_path):
    plans = [
        make(tmp_path, "a/seed_0", "raise SystemExit('error: no luck')"),
        make(tmp_path, "a/seed_1"),
        make(tmp_path, "a/seed_2", "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"),
        make(tmp_path, "a/seed_3", "raise ValueError('not run')", Action.skip),
    ]
    failed, shown = run(plans)
    assert [plan.job.name for plan in failed] == ["a/seed_0", "a/seed_2"]
    assert "failed a/seed_0, which ended with exit code 1: error: no luck" in shown
    assert "finished a/seed_1" in shown
    assert "failed a/seed_2, which was killed by SIGKILL" in shown
    assert f": see {tmp_path / 'a' / 'seed_2.log'}" in shown
    assert "a/seed_3" not in shown
    assert "error: no luck" in (tmp_path / "a" / "seed_0.log").read_text()


def test_no_more_processes_run_than_asked_for(tmp_path):
    """Each fails if the file of another one exists while it runs."""
    flag = tmp_path / "running"
    code = f"import os, time; os.mkdir({str(flag)!r}); time.sleep(0.1); os.rmdir({str(flag)!r})"
    failed, _ = run([make(tmp_path, f"a/seed_{k}", code) for k in range(3)], at_once=1)
    assert not failed


def test_a_process_knows_its_parent_and_its_threads(tmp_path, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    plan = make(
        tmp_path, "a", f"import os; print(*map(os.getenv, ({PARENT!r}, 'OMP_NUM_THREADS')))"
    )
    run([plan])
    assert plan.job.log.read_text().split() == [str(os.getpid()), "1"]


def test_a_run_that_another_sweep_still_runs_is_not_started_again(tmp_path):
    plan = make(tmp_path, "a", "print('second')")
    holder = "import fcntl, time; fcntl.flock(1, fcntl.LOCK_EX); print(flush=True); time.sleep(60)"
    with plan.job.log.open("ab") as log:
        first = subprocess.Popen([sys.executable, "-S", "-c", holder], stdout=log)
    while not plan.job.log.read_bytes():
        time.sleep(0.01)
    failed, shown = run([plan])
    first.kill()
    first.wait()
    assert failed == [plan]
    assert f"{plan.job.log} is in use: its run has not ended" in shown
    assert "second" not in plan.job.log.read_text()
    assert run([plan])[0] == []  # the lock ends with its process


SWEEP = """
import pathlib, signal, sys
from veca_marl.sweeps.plans import Action, Job, Plan
from veca_marl.sweeps.sweep import run_all
from veca_marl.sweeps.sweep import Progress
folder = pathlib.Path(sys.argv[1])
code = f"import os, time; open('{folder}/' + str(os.getpid()), 'w'); time.sleep(60)"
jobs = [Job(n, folder / n, [], {"total_frames": 1}) for n in ("a", "b", "c")]
signal.signal(signal.SIGINT, signal.default_int_handler)
run_all([Plan(job, Action.start, ("-S", "-c", code)) for job in jobs], 2, {}, Progress(3, 3))
"""


def test_ctrl_c_ends_all_processes(tmp_path):
    running = subprocess.Popen(
        [sys.executable, "-c", SWEEP, tmp_path], stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while len(pids(tmp_path)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, shown = running.communicate(timeout=60)
    assert "interrupting 2 runs; the same command continues them" in shown
    assert running.returncode == -signal.SIGINT
    assert len(pids(tmp_path)) == 2  # the third was not started
    for pid in pids(tmp_path):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def pids(folder):
    return [int(path.name) for path in folder.iterdir() if path.name.isdigit()]


def all_fit(jobs, cores):
    return len(jobs)


def test_failed_runs_are_named_with_their_logs(tmp_path, monkeypatch, capsys):
    plans = [make(tmp_path, "a", "raise SystemExit(3)"), make(tmp_path, "b")]
    monkeypatch.setattr(sweep, "plan", lambda job: plans[job.name == "b"])
    with pytest.raises(SweepError, match=naming("1 of 2", f"a ({tmp_path / 'a'}.log)")):
        run_sweep([plan.job for plan in plans], 2, 1, all_fit)
    assert (
        "2 runs: 0 skipped (they have ended), 0 to continue, 2 to start" in capsys.readouterr().err
    )


def test_two_jobs_with_one_folder_are_refused(tmp_path):
    with pytest.raises(SweepError, match=naming("2 ", tmp_path / "a", "hydra.sweep.subdir")):
        run_sweep([make(tmp_path, "a").job] * 2, 2, 1, all_fit)


def test_the_line_of_progress_has_frames_and_the_time_left(tmp_path):
    (tmp_path / "metrics.csv").write_text("frames,iteration\n40,1\n80,2\n")
    assert frames_so_far(tmp_path) == 80
    assert frames_so_far(tmp_path / "none") == 0
    (tmp_path / "metrics.csv").unlink()
    (tmp_path / "progress.json").write_text('{"frames": 64, "ended": false}')
    assert frames_so_far(tmp_path) == 64
    now = 0.0
    out = io.StringIO()
    progress = Progress(400, 4, out, lambda: now)
    progress.update(100, 2, 1)  # 100 frames are of an earlier sweep
    now = 30.0
    progress.update(150, 2, 1)
    assert not progress.due
    assert out.getvalue().count("\n") == 1  # too early for another line
    now = 60.0
    progress.update(200, 2, 1)
    assert (
        out.getvalue()
        .splitlines()[-1]
        .endswith("1 of 4 runs ended, 2 running; 200 of 400 frames (50 %), about 2 min left")
    )


def test_a_damaged_file_of_a_run_does_not_end_the_display_of_all(tmp_path):
    (tmp_path / "progress.json").write_text("{")
    assert frames_so_far(tmp_path) == 0

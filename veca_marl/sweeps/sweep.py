"""A sweep: all its runs are planned, then those that have not ended are run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from veca_marl.sweeps.plans import Action, Job, Plan, SweepError, plan
from veca_marl.sweeps.processes import run_all
from veca_marl.sweeps.progress import Progress


def run_sweep(jobs: Sequence[Job], at_once: int, threads: int) -> None:
    """Run all jobs that have not ended.

    Nothing is started if one of them cannot be planned.

    Args:
        jobs: The runs.
        at_once: Number of runs at a time.
        threads: Torch threads of runs that have no number of their own.

    Raises:
        SweepError: If a folder belongs to two jobs or to a run of another configuration, or if
            jobs failed; the message names all of them with their log files.
        KeyboardInterrupt: After all processes have ended.
    """
    for folder, count in Counter(job.folder for job in jobs).items():
        if count > 1:
            raise SweepError(f"{count} jobs have the folder {folder}: set hydra.sweep.subdir")
    plans = [plan(job) for job in jobs]
    progress = Progress(sum(job.frames for job in jobs), len(jobs))
    progress.event(_announcement(plans, at_once))
    failed = run_all(plans, at_once, threads, progress)
    if failed:
        logs = ", ".join(f"{one.job.name} ({one.job.log})" for one in failed)
        raise SweepError(f"{len(failed)} of {len(jobs)} runs failed: {logs}")
    progress.event(f"all {len(jobs)} runs have ended")


def _announcement(plans: Sequence[Plan], at_once: int) -> str:
    counts = Counter(one.action for one in plans)
    return (
        f"{len(plans)} runs: {counts[Action.skip]} skipped (they have ended), "
        f"{counts[Action.resume]} to continue, {counts[Action.start]} to start; "
        f"at most {at_once} at a time"
    )

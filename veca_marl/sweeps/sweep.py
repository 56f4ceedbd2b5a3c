"""A sweep: all its runs are planned, then those that have not ended are run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from veca_marl.sweeps.cores import default_jobs
from veca_marl.sweeps.plans import Action, Job, Plan, SweepError, plan
from veca_marl.sweeps.processes import run_all
from veca_marl.sweeps.progress import Progress

Fit = Callable[[Sequence[Job]], int]
"""Returns how many of some jobs fit into the memory of the machine, whichever of them they are.

It raises `ValueError` if one does not fit alone.
"""


def run_sweep(jobs: Sequence[Job], most: int | None, cores: int, fit: Fit) -> None:
    """Run all jobs that have not ended.

    Nothing is started if one of them cannot be planned.

    Args:
        jobs: The runs.
        most: Largest number of runs at a time; None is as many as the cores can run at once.
        cores: Number of cores, which runs share that have no number of threads of their own.
        fit: Limits the number of runs at a time further.

    Raises:
        SweepError: If a folder belongs to two jobs or to a run of another configuration, or if
            jobs failed; the message names all of them with their log files.
        ValueError: If a run does not fit into the memory alone.
        KeyboardInterrupt: After all processes have ended.
    """
    for folder, count in Counter(job.folder for job in jobs).items():
        if count > 1:
            raise SweepError(f"{count} jobs have the folder {folder}: set hydra.sweep.subdir")
    plans = [plan(job) for job in jobs]
    progress = Progress(sum(job.frames for job in jobs), len(jobs))
    left = [one.job for one in plans if one.action is not Action.skip]
    asked = most or default_jobs([job.asked for job in left], cores)
    at_once = min(asked, fit(left)) if left else asked
    progress.event(_announcement(plans, at_once, asked))
    failed = run_all(plans, at_once, max(1, cores // at_once), progress)
    if failed:
        logs = ", ".join(f"{one.job.name} ({one.job.log})" for one in failed)
        raise SweepError(f"{len(failed)} of {len(jobs)} runs failed: {logs}")
    progress.event(f"all {len(jobs)} runs have ended")


def _announcement(plans: Sequence[Plan], at_once: int, asked: int) -> str:
    counts = Counter(one.action for one in plans)
    limit = f", because {asked} do not fit into the memory" if at_once < asked else ""
    return (
        f"{len(plans)} runs: {counts[Action.skip]} skipped (they have ended), "
        f"{counts[Action.resume]} to continue, {counts[Action.start]} to start; "
        f"at most {at_once} at a time{limit}"
    )

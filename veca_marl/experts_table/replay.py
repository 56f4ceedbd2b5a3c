"""Stored episodes that are played once more: does the present code play them the same way?

The configuration of a game says nothing about changes of the code. On another kind of processor
the last digits can differ, and episodes with contacts then go another way.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from veca_marl.envs.core.game_cfg import Script
from veca_marl.experts_table.play import Job, Played
from veca_marl.experts_table.processes import play_all


class StaleEpisodesError(RuntimeError):
    """Stored episodes are played in another way by the present code."""


def replay(
    stored: Mapping[str, Sequence[Played]], count: int, overrides: Sequence[str], processes: int
) -> str:
    """Play some stored episodes of each task and policy, and compare them with their rows.

    Args:
        stored: Rows by task.
        count: Number of episodes for each task and policy, spread over the stored ones.
        overrides: Changes of the configuration with which they were stored.
        processes: Processes that play at the same time.

    Returns:
        A sentence that says how many were compared.

    Raises:
        StaleEpisodesError: If a return, the goal or the number of steps differs.
        LostProcessError: See `play_all`.
    """
    chosen = {
        (task, row.policy, row.episode): row
        for task, rows in stored.items()
        for row in spread(rows, count)
    }
    jobs = [
        Job(task, tuple(overrides), Script(policy), episode, row.version > 0)
        for (task, policy, episode), row in chosen.items()
    ]
    other = []
    for job, now in play_all(jobs, processes, ""):
        row = chosen[job.task, job.policy.value, job.episode]
        if _outcome(now) != _outcome(row):
            other.append(job.task)
            sys.stderr.write(
                f"{job.task} {row.policy} {row.episode}: {_text(now)} now, {_text(row)} at "
                f"{row.commit[:7]}\n"
            )
    if other:
        raise StaleEpisodesError(
            f"{len(other)} of {len(jobs)} stored episodes differ, of {sorted(set(other))}: delete "
            "the files of these tasks and play them anew, or replay on the processor of the rows"
        )
    return f"{len(jobs)} stored episodes are the same"


def spread(rows: Sequence[Played], count: int) -> Iterator[Played]:
    """Return up to `count` rows of each policy, evenly spread over its episodes."""
    ordered = sorted(rows, key=lambda row: (row.policy, row.episode))
    for _, group in groupby(ordered, lambda row: row.policy):
        episodes = list(group)
        places = np.linspace(0, len(episodes) - 1, min(count, len(episodes)))
        yield from (episodes[int(place)] for place in places)


def _outcome(played: Played) -> tuple[float, float | None, int]:
    return played.score, played.solved, played.steps


def _text(played: Played) -> str:
    solved = "" if played.solved is None else f", solved {played.solved:g}"
    return f"return {played.score}{solved}, {played.steps} steps"

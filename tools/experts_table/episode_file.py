"""The file of the episodes of one task, and stored episodes that are played once more.

Episodes are played once more because the configuration of a game says nothing about changes of the
code. On another kind of processor the last digits can differ, and episodes with contacts then go
another way.
"""

from __future__ import annotations

import csv
import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from io import StringIO
from itertools import groupby
from pathlib import Path

import numpy as np

from tools.experts_table.play import Job, Played, play_all
from veca_marl.algos.files import write_errors
from veca_marl.envs.core.game_cfg import Script

_ADVICE = "choose another folder (to=FOLDER) or delete the file"
_COLUMNS = [field.name for field in fields(Played)]


class EpisodeFile:
    """Episodes of one task as CSV. A process that is killed loses the running episode only.

    Args:
        path: The file; it may be missing.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> list[Played]:
        """Return the stored episodes; an incomplete last line is left out.

        Raises:
            ValueError: If the file has other columns, a value that is none of its column, or an
                episode twice.
        """
        if not self._path.exists():
            return []
        complete, _, _ = self._path.read_text(encoding="utf-8").rpartition("\n")
        reader = csv.DictReader(StringIO(complete))
        if reader.fieldnames is not None and reader.fieldnames != _COLUMNS:
            raise ValueError(f"{self._path} has the columns {reader.fieldnames}, not {_COLUMNS}")
        try:
            episodes = [_played(row) for row in reader]
        except (TypeError, ValueError) as error:
            raise ValueError(f"{self._path}, line {reader.line_num}: {error}") from error
        counts = Counter((one.policy, one.episode) for one in episodes)
        for (policy, episode), count in counts.items():
            if count > 1:
                raise ValueError(
                    f"{self._path} has episode {episode} of policy {policy} {count} times: delete "
                    "all of these lines but one"
                )
        return episodes

    def check(self, stored: Iterable[Played], configuration: str, version: int) -> None:
        """Check that stored episodes are of one configuration and have the same starts.

        Args:
            stored: The episodes.
            configuration: `digest` of the game.
            version: Version of the frozen episodes, 0 for other starts.

        Raises:
            ValueError: If they are of another one; the message names what to do.
        """
        for row in stored:
            if row.configuration != configuration:
                raise ValueError(f"{self._path} has episodes of another configuration: {_ADVICE}")
            if row.version != version:
                raise ValueError(
                    f"{self._path} has episodes with starts of version {row.version}, not "
                    f"{version} (0: not frozen): {_ADVICE}"
                )

    def add(self, played: Played) -> None:
        """Add an episode and write it to the disk.

        Raises:
            WriteError: If the file cannot be written.
        """
        with write_errors(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._cut_incomplete_line()
            with self._path.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
                if file.tell() == 0:
                    writer.writeheader()
                writer.writerow(asdict(played))
                file.flush()
                os.fsync(file.fileno())

    def _cut_incomplete_line(self) -> None:
        if not self._path.exists():
            return
        content = self._path.read_bytes()
        complete = content.rfind(b"\n") + 1
        if complete < len(content):
            os.truncate(self._path, complete)


def _played(row: dict[str, str]) -> Played:
    return Played(
        policy=row["policy"],
        episode=int(row["episode"]),
        score=float(row["score"]),
        solved=float(row["solved"]) if row["solved"] else None,
        steps=int(row["steps"]),
        agents=int(row["agents"]),
        processor_s=float(row["processor_s"]),
        configuration=row["configuration"],
        version=int(row["version"]),
        commit=row["commit"],
    )


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
        WorkerError: See `play_all`.
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

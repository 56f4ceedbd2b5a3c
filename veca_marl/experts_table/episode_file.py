"""The file of the episodes of one task, to which a line is added when an episode ends."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, fields
from io import StringIO
from pathlib import Path

from veca_marl.algos.files import write_errors
from veca_marl.experts_table.play import Played

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

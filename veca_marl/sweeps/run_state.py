"""How far a run on disk has come, read from its files alone.

The stored configuration has the numbers of a body, not its class. Two kinds with the same numbers
are different bodies: their names are compared with the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from veca_marl.migrations import VersionError, migrated
from veca_marl.runs.continuation import RunProgress, read_progress
from veca_marl.stored_files import (
    Columns,
    Row,
    StoredFileError,
    read_growing_table,
    read_json,
    read_yaml,
)

_KEY = "registered_name"
_LABELS = ("frames", "player", "team")  # columns that are no measurements
TABLES = {
    "evaluations": Columns(whole=("frames",), words=("player", "team"), may_be_whole=("episodes",)),
    "metrics": Columns(whole=("frames",), numbers=("frames_per_s",)),
}
"""The tables of a run by the names of their files, and the columns that are read by name."""


def with_body_kinds(plain: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return a configuration in which each body has its registered name beside its numbers.

    Args:
        plain: The configuration as plain data.
        names: Registered name by the dotted path of a body, see `config.stored.body_names`.
    """
    marked = deepcopy(dict(plain))
    for path, name in names.items():
        node: Any = marked
        for part in path.split("."):
            node = node.get(part) if isinstance(node, dict) else None
        if isinstance(node, dict):
            node[_KEY] = name
    return marked


def stored_kinds(provenance: Path) -> dict[str, str]:
    """Return the names in the ``provenance.json`` of a run; none if it has no such file or entry.

    A damaged file is reported by what needs the rest of it.
    """
    try:
        names = read_json(provenance).get("bodies")
    except StoredFileError:
        return {}
    return dict(names) if isinstance(names, dict) else {}


class RunState(Enum):
    """How far a run has come.

    Attributes:
        missing: There is no run.
        unfinished: It has begun and not ended: it was interrupted, failed, or goes on.
        cut: It has ended by ``max_minutes``, before its last frame.
        finished: It has ended with its last frame.
    """

    missing = "missing"
    unfinished = "unfinished"
    cut = "cut"
    finished = "finished"


@dataclass(frozen=True)
class StoredRun:
    """A run on disk.

    Attributes:
        folder: Its folder.
        config: Its configuration as plain data, in the form of this version (`migrated`) and with
            the kinds of bodies (`with_body_kinds`); None if there is no run.
        stored_progress: Content of its ``progress.json``; None without one.
    """

    folder: Path
    config: dict[str, Any] | None
    stored_progress: RunProgress | None = None

    @property
    def progress(self) -> RunProgress:
        """Where it stands; for a run of version 0.2, which has no such file, by its other files.

        Raises:
            StoredFileError: See `rows`.
        """
        if self.stored_progress is not None:
            return self.stored_progress
        evaluated = (int(row["frames"]) for row in self.rows("evaluations"))
        return RunProgress(max(evaluated, default=0), (self.folder / "comparison.txt").is_file())

    def rows(self, kind: str) -> list[Row]:
        """Return the complete rows of ``evaluations.csv`` or ``metrics.csv``; none without a file.

        The last row is incomplete while a run writes it.

        Raises:
            StoredFileError: If the file is damaged.
        """
        path = self.folder / f"{kind}.csv"
        return read_growing_table(path, TABLES[kind]) if path.is_file() else []

    def state(self, total_frames: int, max_minutes: float | None) -> RunState:
        """Return how far it has come on the way to a budget.

        Args:
            total_frames: Frames that it is to have.
            max_minutes: Minutes that it may take; None for no limit.

        Raises:
            StoredFileError: If a file that says it is damaged.
        """
        if self.config is None:
            return RunState.missing
        progress = self.progress
        if not progress.ended:
            return RunState.unfinished
        if progress.frames >= total_frames:
            return RunState.finished
        # one that had all frames of its own budget was not cut by the time
        of_its_own = self.config.get("total_frames", total_frames)
        if not (isinstance(of_its_own, (int, float)) and math.isfinite(of_its_own)):
            reason = f"total_frames={of_its_own!r} is no number of frames"
            raise StoredFileError(self.folder / "config.yaml", reason)
        limited = max_minutes is not None and self.config.get("max_minutes") == max_minutes
        return RunState.cut if limited and progress.frames < of_its_own else RunState.unfinished


def final_score(rows: Iterable[Mapping[str, Any]], experiment: Mapping[str, Any]) -> float:
    """Return what a run is optimised by: the last evaluation of its policy.

    Args:
        rows: Rows of ``evaluations.csv``.
        experiment: Node ``experiment`` of its configuration, which names `metric` and `team`.

    Raises:
        ValueError: If the policy was not evaluated, there is no such metric or team, or several
            teams were evaluated and none is named.
    """
    of_policy = [row for row in rows if row["player"] == "policy"]
    teams, asked = sorted({str(row["team"]) for row in of_policy}), experiment["team"]
    if not teams:
        raise ValueError("no evaluation of its policy is stored (log.logger needs csv)")
    if asked not in teams and (asked is not None or len(teams) > 1):
        raise ValueError(f"experiment.team={asked}: choices: {', '.join(teams)}")
    last = [row for row in of_policy if asked in (None, row["team"])][-1]
    metric = experiment["metric"]
    if metric in _LABELS or last.get(metric) in (None, ""):
        choices = ", ".join(key for key in last if key not in _LABELS)
        raise ValueError(f"experiment.metric={metric}: choices: {choices}")
    return float(last[metric])


def read_run(folder: Path) -> StoredRun:
    """Return the run in a folder, which may be missing.

    Raises:
        ValueError: If its ``config.yaml`` or its ``progress.json`` cannot be read, or a newer
            version has stored it.
    """
    path = folder / "config.yaml"
    if not path.is_file():
        return StoredRun(folder, None)
    config = read_yaml(path)
    try:
        config = migrated(config)
    except VersionError as error:
        raise ValueError(f"{path}: {error}") from error
    marked = with_body_kinds(config, stored_kinds(folder / "provenance.json"))
    return StoredRun(folder, marked, read_progress(folder))

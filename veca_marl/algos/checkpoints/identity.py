"""What a checkpoint belongs to, and how two of its descriptions differ."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from veca_marl.algos.checkpoints.checkpoint_file import CheckpointError
from veca_marl.algos.specs import TeamSpec

_ABSENT = "absent"


@dataclass(frozen=True)
class Identity:
    """What a checkpoint belongs to.

    Attributes:
        task: Name of the task.
        specs: Team name to its arrays.
    """

    task: str
    specs: dict[str, TeamSpec]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"task": self.task, "specs": {t: s.to_dict() for t, s in self.specs.items()}}


def check_identity(path: Path, stored: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Check that a stored identity is the wanted one.

    Raises:
        CheckpointError: If the checkpoint at `path` is of another task or other specs.
    """
    if stored["task"] != wanted["task"]:
        raise CheckpointError(f"{path} is of task {stored['task']}, wanted: {wanted['task']}")
    differing = [
        f"{name}: {in_file} in the checkpoint, {in_run} in this run"
        for name, in_file, in_run in _differences(stored["specs"], wanted["specs"])
    ]
    if differing:
        raise CheckpointError(f"{path} was made for other specs: {'; '.join(differing)}")


def spec_differences(stored: dict[str, Any], spec: TeamSpec) -> str:
    """Return how a stored specification differs from `spec`; empty if it does not."""
    return "; ".join(
        f"{name}: {in_file} in the checkpoint, {in_run} in this run"
        for name, in_file, in_run in _differences(stored, spec.to_dict())
    )


def _differences(one: Any, other: Any, name: str = "") -> list[tuple[str, Any, Any]]:
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            found
            for key in sorted({*one, *other})
            for found in _differences(
                one.get(key, _ABSENT), other.get(key, _ABSENT), f"{name}.{key}".lstrip(".")
            )
        ]
    return [] if one == other else [(name, one, other)]


def check_config(
    path: Path,
    stored: dict[str, Any],
    config: dict[str, Any],
    may_change: Collection[str],
    by_team: Collection[str] = (),
) -> None:
    """Check that a configuration is the stored one; fields of newer versions are ignored.

    Args:
        path: The checkpoint.
        stored: Its configuration as plain data.
        config: That of the run that is to continue.
        may_change: First parts of the keys in which they may differ.
        by_team: Keys of mappings from the names of teams: an entry that the stored ones do not
            have is a difference.

    Raises:
        CheckpointError: If they differ elsewhere.
    """
    differing = [
        f"{name} was {before}, is {now}"
        for name, before, now in _differences(stored, config)
        if (before != _ABSENT or _is_entry(name, by_team))
        and name.partition(".")[0] not in may_change
    ]
    if differing:
        raise CheckpointError(
            f"{path} is of another configuration: {'; '.join(differing)}; "
            f"a resumed run may change {', '.join(may_change) or 'nothing'}"
        )


def _is_entry(name: str, mappings: Collection[str]) -> bool:
    """Return whether a key is that of an entry of one of some mappings."""
    mapping, _, entry = name.partition(".")
    return mapping in mappings and "." not in entry

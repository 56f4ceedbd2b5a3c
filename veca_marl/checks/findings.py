"""The result of the checks of a task."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """Result of one check.

    Attributes:
        passed: The property holds in what was played.
        failed: It does not, or the check ended with an exception of the task.
        skipped: It could not be checked; the message states why.
    """

    passed = "passed"
    failed = "failed"
    skipped = "skipped"


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Attributes:
        check: Name of the check.
        status: Whether it passed.
        message: What was measured, or what is wrong, in one line.
    """

    check: str
    status: Status
    message: str

    def __str__(self) -> str:
        return f"{self.status.value:<8}{self.check}: {self.message}"


@dataclass(frozen=True)
class TaskReport:
    """Results of all checks of a task; ``print(report)`` shows one line for each.

    Attributes:
        task: Name of the task.
        findings: The results in the order of the checks.
    """

    task: str
    findings: tuple[Finding, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed; skipped checks do not count."""
        return not self.failed

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The results of the checks that failed."""
        return tuple(f for f in self.findings if f.status is Status.failed)

    def __getitem__(self, check: str) -> Finding:
        """Return the result of one check.

        Raises:
            KeyError: If there is no such check; the message lists the names.
        """
        for finding in self.findings:
            if finding.check == check:
                return finding
        raise KeyError(f"no check {check!r}; there are {[f.check for f in self.findings]}")

    def __str__(self) -> str:
        counts = {s: sum(f.status is s for f in self.findings) for s in Status}
        total = ", ".join(f"{count} {status.value}" for status, count in counts.items())
        return "\n".join([f"{self.task}: {total}", *map(str, self.findings)])


def finding(check: str, problems: Sequence[str], measured: str) -> Finding:
    """Return a failed result with the problems, or a passed one with what was measured.

    Args:
        check: Name of the check.
        problems: What is wrong; the first three are reported, with the number of the others.
        measured: Message of a check that passed.
    """
    if not problems:
        return Finding(check, Status.passed, measured)
    more = [f"and {len(problems) - 3} more"] if len(problems) > 3 else []
    return Finding(check, Status.failed, "; ".join([*problems[:3], *more]))


def guarded(names: Sequence[str], check: Callable[[], Iterator[Finding]]) -> list[Finding]:
    """Return the results of a function; an exception is a failed result of what it did not reach.

    Args:
        names: Names of the checks that the function makes, in their order.
        check: Yields a result for each name.
    """
    found: list[Finding] = []
    try:
        found.extend(check())
    except Exception as error:
        found += [Finding(name, Status.failed, _described(error)) for name in names[len(found) :]]
    return found


def _described(error: Exception) -> str:
    """Return type, message and place of an exception in one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text} ({place.filename}:{place.lineno}, in {place.name})"

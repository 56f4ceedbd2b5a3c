"""Claims of an experiment as data: one line of text each, in a small grammar.

================================ =====================================================
``hrtf > mono``                  the final score of an arm is above that of another arm
``hrtf > 1.25 x mono``           ... above a multiple of that of another arm
``hrtf > random``                ... above that of the random policy (or ``expert``)
``hrtf > 6.0``                   ... above a number
``9 runs of hrtf > 6.0``         at least so many runs of an arm end above a number
``bfloat16 = float32 +- 0.5``    the final scores of two arms differ by at most a number
``hrtf faster than mono``        an arm needs fewer frames to reach the threshold than another
================================ =====================================================
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

BASELINES = ("random", "expert")
"""Policies that do not learn, to which an arm can be compared."""

_NUMBER = r"[+-]?\d+(?:\.\d*)?"
_NAME = r"[A-Za-z_][\w.-]*"
_ABOVE = re.compile(rf"({_NAME}) > ({_NAME})")
_ABOVE_NUMBER = re.compile(rf"({_NAME}) > ({_NUMBER})")
_RUNS_ABOVE = re.compile(rf"(\d+) runs of ({_NAME}) > ({_NUMBER})")
_TIMES = re.compile(rf"({_NAME}) > ({_NUMBER}) x ({_NAME})")
_FASTER = re.compile(rf"({_NAME}) faster than ({_NAME})")
_EQUAL = re.compile(rf"({_NAME}) = ({_NAME}) \+- ({_NUMBER})")


@dataclass(frozen=True)
class Above:
    """The interquartile mean of an arm is above that of another arm or of a baseline."""

    arm: str
    other: str


@dataclass(frozen=True)
class AboveNumber:
    """The interquartile mean of an arm is above a number."""

    arm: str
    number: float


@dataclass(frozen=True)
class RunsAbove:
    """At least `runs` runs of an arm end above a number."""

    runs: int
    arm: str
    number: float


@dataclass(frozen=True)
class Equal:
    """The interquartile means of two arms differ by at most `margin`."""

    arm: str
    other: str
    margin: float


@dataclass(frozen=True)
class AboveTimes:
    """The interquartile mean of an arm is above `factor` times that of another arm.

    It states a relative difference where 0 is the worst score; of a negative score a multiple is
    lower, not higher.
    """

    arm: str
    factor: float
    other: str


@dataclass(frozen=True)
class Faster:
    """Runs of an arm reach the threshold of the experiment in fewer frames than those of another.

    A run that does not reach it is slower than each that does.
    """

    arm: str
    other: str


Claim = Above | AboveNumber | AboveTimes | RunsAbove | Equal | Faster


def parse_claim(text: str, arms: Collection[str]) -> Claim:
    """Return the claim that a line of text states.

    Args:
        text: See the table above; words and symbols are separated by blanks.
        arms: Names of the arms of the experiment.

    Raises:
        ValueError: If the text does not follow the grammar, or names an arm that does not exist.
    """
    claim = _parse(" ".join(text.split()))
    if claim is None:
        raise ValueError(
            f"claim {text!r}: expected 'ARM > ARM', 'ARM > random', 'ARM > expert', 'ARM > NUMBER',"
            " 'ARM > NUMBER x ARM', 'N runs of ARM > NUMBER', 'ARM = ARM +- NUMBER' or 'ARM faster"
            " than ARM'"
        )
    for arm in _arms_of(claim):
        if arm not in arms:
            raise ValueError(f"claim {text!r}: no arm {arm!r}; choices: {', '.join(arms)}")
    if isinstance(claim, Equal) and not claim.margin > 0:
        raise ValueError(f"claim {text!r}: the margin must be positive, got {claim.margin}")
    if isinstance(claim, AboveTimes) and not claim.factor > 0:
        raise ValueError(f"claim {text!r}: the factor must be positive, got {claim.factor}")
    return claim


def _arms_of(claim: Claim) -> list[str]:
    """Return the arms that a claim names; baselines are none, and can follow ``>`` alone."""
    if isinstance(claim, Above):
        return [claim.arm, *([] if claim.other in BASELINES else [claim.other])]
    if isinstance(claim, AboveTimes | Equal | Faster):
        return [claim.arm, claim.other]
    return [claim.arm]


def _parse(text: str) -> Claim | None:
    if match := _RUNS_ABOVE.fullmatch(text):
        return RunsAbove(int(match[1]), match[2], float(match[3]))
    if match := _ABOVE_NUMBER.fullmatch(text):
        return AboveNumber(match[1], float(match[2]))
    if match := _ABOVE.fullmatch(text):
        return Above(match[1], match[2])
    if match := _TIMES.fullmatch(text):
        return AboveTimes(match[1], float(match[2]), match[3])
    if match := _FASTER.fullmatch(text):
        return Faster(match[1], match[2])
    if match := _EQUAL.fullmatch(text):
        return Equal(match[1], match[2], float(match[3]))
    return None

"""Claims of an experiment as data: one line of text each, in a small grammar.

================================ =====================================================
``hrtf > mono``                  the final score of an arm is above that of another arm
``hrtf > random``                ... above that of the random policy (or ``expert``)
``hrtf > 6.0``                   ... above a number
``9 runs of hrtf > 6.0``         at least so many runs of an arm end above a number
``bfloat16 = float32 +- 0.5``    the final scores of two arms differ by at most a number
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


Claim = Above | AboveNumber | RunsAbove | Equal


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
            " 'N runs of ARM > NUMBER' or 'ARM = ARM +- NUMBER'"
        )
    named = [claim.arm]
    if isinstance(claim, Above | Equal) and claim.other not in BASELINES:
        named.append(claim.other)
    for arm in named:
        if arm not in arms:
            raise ValueError(f"claim {text!r}: no arm {arm!r}; choices: {', '.join(arms)}")
    if isinstance(claim, Equal) and not claim.margin > 0:
        raise ValueError(f"claim {text!r}: the margin must be positive, got {claim.margin}")
    return claim


def _parse(text: str) -> Claim | None:
    if match := _RUNS_ABOVE.fullmatch(text):
        return RunsAbove(int(match[1]), match[2], float(match[3]))
    if match := _ABOVE_NUMBER.fullmatch(text):
        return AboveNumber(match[1], float(match[2]))
    if match := _ABOVE.fullmatch(text):
        return Above(match[1], match[2])
    if match := _EQUAL.fullmatch(text):
        return Equal(match[1], match[2], float(match[3]))
    return None

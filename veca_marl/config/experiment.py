"""What an experiment compares, on which seeds, and what it claims.

A claim is one line of text, in a small grammar:

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
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from veca_marl.config.errors import ConfigError
from veca_marl.override_text import normalised

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


_ARM_NAME = re.compile(r"[A-Za-z_][\w.-]*")


@dataclass
class ExperimentCfg:
    """Arms, seeds and claims of an experiment; a file of the group ``experiment`` sets them.

    ``python -m veca_marl.train -m +experiment=NAME`` runs every arm with every seed,
    ``python -m veca_marl.report +experiment=NAME`` compares their returns.

    Attributes:
        name: Name of the experiment; its runs lie in ``runs/<name>/<arm>/seed_<seed>``. None for a
            run that belongs to no experiment.
        arm: Arm that a run belongs to; the sweep sets it.
        arms: Overrides of each arm, such as ``hrtf: [senses/audio=hrtf]``.
        seeds: Seeds that every arm is run with.
        claim: The claim in words.
        claims: The claim as data, such as ``hrtf > mono``, see `veca_marl.config.experiment`.
        metric: Column of ``evaluations.csv`` that is compared.
        team: Team that is compared; None is the only team that learns.
        threshold: The report states the frames and minutes until the metric reaches this; None
            states none. Claims with ``faster than`` need it.
    """

    name: str | None = None
    arm: str | None = None
    arms: dict[str, list[str]] = field(default_factory=dict)
    seeds: list[int] = field(default_factory=list)
    claim: str = ""
    claims: list[str] = field(default_factory=list)
    metric: str = "return"
    team: str | None = None
    threshold: float | None = None

    def __post_init__(self) -> None:
        if self.name is None and (self.arms or self.seeds or self.claims):
            raise ValueError("experiment.name: an experiment with arms, seeds or claims needs one")
        for word in [*([] if self.name is None else [self.name]), *self.arms]:
            _check_name(word)
        if self.arm is not None and self.arm not in self.arms:
            raise ValueError(
                f"experiment.arm={self.arm}: no such arm; choices: {', '.join(self.arms)}"
            )
        if len(set(self.seeds)) < len(self.seeds) or min(self.seeds, default=0) < 0:
            raise ValueError(
                f"experiment.seeds must differ and be 0 or more, got {list(self.seeds)}"
            )
        for text in self.claims:
            if isinstance(parse_claim(text, self.arms), Faster) and self.threshold is None:
                raise ValueError(f"claim {text!r}: experiment.threshold must say faster to what")


def _check_name(word: str) -> None:
    if not _ARM_NAME.fullmatch(word) or word in BASELINES:
        raise ValueError(
            f"experiment: {word!r} cannot be the name of an experiment or arm: letters, digits, "
            f"'_', '.' and '-', beginning with a letter; not {' or '.join(BASELINES)}"
        )


def check_arm(experiment: ExperimentCfg, overrides: Sequence[str]) -> None:
    """Check that a run that belongs to an arm has the overrides of the arm.

    Args:
        experiment: The experiment, with the arm of the run; an arm that it has not is not checked.
        overrides: All overrides of the run.

    Raises:
        ConfigError: If some are missing: ``experiment.arm`` alone changes nothing.
    """
    arm, given = experiment.arm, normalised(overrides)
    if arm is None or arm not in experiment.arms:
        return
    missing = [text for text in normalised(experiment.arms[arm]) if text not in given]
    if missing:
        raise ConfigError(
            f"experiment.arm={arm} is a run without {', '.join(missing)}: "
            f"python -m veca_marl.train -m +experiment={experiment.name} experiment.arm={arm} "
            "adds the overrides of an arm"
        )


def check_contradictions(arm: str, own: Sequence[str], overrides: Sequence[str]) -> None:
    """Check that no override of a command is also set by an arm, which would replace it.

    Args:
        arm: Name of the arm.
        own: Overrides of the arm.
        overrides: Overrides of the command.

    Raises:
        ConfigError: If there is one.
    """
    by_key = {_key(text): text for text in own}
    for text in overrides:
        other = by_key.get(_key(text))
        if other is not None and other != text:
            raise ConfigError(
                f"{text}: arm {arm} sets {other}; give experiment.arms.{arm}=[...] instead"
            )


def _key(override: str) -> str:
    return override.lstrip("+~").partition("=")[0]

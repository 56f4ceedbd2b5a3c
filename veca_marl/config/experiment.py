"""What an experiment compares, on which seeds, and what it claims."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from veca_marl.config.claims import BASELINES, Faster, parse_claim

_NAME = re.compile(r"[A-Za-z_][\w.-]*")


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
        claims: The claim as data, such as ``hrtf > mono``, see `veca_marl.config.claims`.
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
    if not _NAME.fullmatch(word) or word in BASELINES:
        raise ValueError(
            f"experiment: {word!r} cannot be the name of an experiment or arm: letters, digits, "
            f"'_', '.' and '-', beginning with a letter; not {' or '.join(BASELINES)}"
        )

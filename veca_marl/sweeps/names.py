"""Names of the runs of a sweep without an experiment: by what is swept, not by what is constant.

The runs of ``-m +task=KickTheBall algo.clip=0.1 senses/audio=hrtf,mono seed=1,2`` lie in
``runs/sweeps/KickTheBall,algo.clip=0.1/senses.audio=hrtf/seed_1`` and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override

from veca_marl.override_text import normalised, short_name

RUNS = Path("runs")
SWEEPS = RUNS / "sweeps"
_UNNAMED = ("seed", "total_frames", "max_minutes", "device", "threads")


def key_of(override: str) -> str:
    """Return the key or the group of an override."""
    return override.lstrip("+~").partition("=")[0]


def folder_of(fixed: Sequence[str]) -> Path:
    """Return the folder of a sweep, from the overrides that all of its runs have."""
    tasks = [text.partition("=")[2] for text in fixed if key_of(text) == "task"]
    others = [text for text in fixed if key_of(text) not in ("task", *_UNNAMED)]
    return SWEEPS / short_name(",".join([*tasks, *map(_plain, others)]) or "default")


def arm_of(varied: Sequence[str]) -> str:
    """Return the name of what a run varies, from the overrides that the sweep chose for it."""
    named = [_plain(text) for text in varied if key_of(text) not in _UNNAMED]
    return short_name(",".join(named) or "default")


def run_name(varied: Sequence[str], seed: int) -> str:
    """Return the folder of a run within that of its sweep."""
    return f"{arm_of(varied)}/seed_{seed}"


def varied_in(job: Sequence[str], command: Sequence[str]) -> list[str]:
    """Return the overrides that a sweep chose for a job, and not its command."""
    fixed = {key_of(text) for text in fixed_in(command)}
    return [text for text in job if key_of(text) not in fixed]


def fixed_in(command: Sequence[str]) -> list[str]:
    """Return the overrides of a command that list no values."""
    return [str(one.input_line) for one in _parsed(command) if not one.is_sweep_override()]


def is_sweep(command: Sequence[str]) -> bool:
    """Return whether a command lists values for a key."""
    return any(one.is_sweep_override() for one in _parsed(command))


def combinations(command: Sequence[str]) -> tuple[list[list[str]], list[int]]:
    """Return what a command varies beside the seed, and the seeds, in their order.

    Returns:
        The overrides of each combination, one empty list if the seed alone is swept; and the seeds,
        none if the command names no seed.
    """
    choices, seeds = [], []
    for one in _parsed(command):
        if one.key_or_group == "seed":
            one_value = [str(one.value())]
            listed = one.sweep_string_iterator() if one.is_sweep_override() else one_value
            seeds = [int(seed) for seed in listed]
        elif one.is_sweep_override():
            key = one.get_key_element()
            choices.append([f"{key}={value}" for value in one.sweep_string_iterator()])
    return [list(chosen) for chosen in product(*choices)], seeds


def _parsed(command: Sequence[str]) -> list[Override]:
    parsed: list[Override] = OverridesParser.create().parse_overrides(normalised(command))
    return parsed


def _plain(override: str) -> str:
    return override.replace("/", ".").replace("+", "")

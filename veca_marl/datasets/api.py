"""What notebooks use: the commands as functions."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from veca_marl.datasets.card import README, illustrate
from veca_marl.datasets.configuration import compose_dataset
from veca_marl.datasets.making import Made
from veca_marl.datasets.making import make as make_stored
from veca_marl.datasets.storage import StoredDataset


def make(
    overrides: Sequence[str],
    n: int,
    out: str | Path | None = None,
    seed: int = 0,
    processes: int = 1,
    progress: bool = False,
) -> StoredDataset:
    """Make a data set with its card, or continue it; return it.

    Args:
        overrides: As on the command line, such as ``["+dataset=sound_localisation"]``.
        n: Number of samples.
        out: Folder of the data set; None is ``datasets/NAME``.
        seed: Seed of all samples.
        processes: Number of processes; with 1 this process makes the samples.
        progress: Whether to show a progress bar.

    Raises:
        ConfigError: If a choice is impossible, or the folder holds something else.
        WriteError: If it cannot be written; what is complete is kept.
        WorkerError: If a process fails.
    """
    return make_with_card(overrides, n, out, seed, processes, progress).stored


def make_with_card(
    overrides: Sequence[str],
    n: int,
    out: str | Path | None,
    seed: int,
    processes: int,
    progress: bool,
) -> Made:
    """See `make`; the result also says how much was made."""
    config = compose_dataset(overrides)
    folder = default_folder(config.dataset.name) if out is None else Path(out)
    words = ["python", "-m", "veca_marl.datasets", "make", *overrides, f"n={n}", f"seed={seed}"]
    made = make_stored(config, folder, n, seed, processes, shlex.join(words), progress)
    if made.blocks or not (folder / README).exists():
        illustrate(made.stored)
    return made


def default_folder(name: str) -> Path:
    """Return the folder of a data set if none is given."""
    return Path("datasets", name)

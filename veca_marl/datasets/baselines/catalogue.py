"""Which baseline belongs to which data set, and the paper's figure beside it."""

from __future__ import annotations

from dataclasses import dataclass

from veca_marl.datasets.baselines.inputs import NetworkInput, Prepare, as_stored, readings, spectra
from veca_marl.datasets.baselines.objectives import (
    Box,
    Classes,
    Contact,
    Direction,
    Disparity,
    Distance,
    Objective,
    Sounding,
)
from veca_marl.datasets.storage import DatasetError, StoredDataset


@dataclass(frozen=True)
class Baseline:
    """What is learnt of a data set.

    Attributes:
        objective: Class of the objective.
        paper: The paper's figure, with its deviation over five runs; empty for our sets.
    """

    objective: type[Objective]
    paper: str = ""


BASELINES: dict[str, Baseline] = {
    "object_classification": Baseline(Classes, "99.7 % +- 0.02 top-1"),
    "tactile_classification": Baseline(Classes, "94.8 % +- 0.64 top-1"),
    "distance_estimation": Baseline(Distance, "1.90 +- 0.30 relative absolute error"),
    "object_recognition": Baseline(Box, "76.1 % +- 1.52 top-1"),
    "sound_localisation": Baseline(Direction, "0.80 +- 0.03 cosine similarity"),
    "depth_disparity": Baseline(Disparity),
    "contact_localisation": Baseline(Contact),
    "audiovisual_correspondence": Baseline(Sounding),
}
"""Baselines by data set."""

PREPARE: dict[str, Prepare] = {
    "image": as_stored,
    "vision": as_stored,
    "waveform": spectra,
    "touch": readings,
    "touch_parts": readings,
}
"""How a stored input becomes what the network reads, by field."""


def find_baseline(stored: StoredDataset) -> Baseline:
    """Return the baseline of a data set.

    Raises:
        DatasetError: If it has none.
    """
    if stored.plan.name not in BASELINES:
        raise DatasetError(
            f"{stored.folder} holds {stored.plan.name!r:.60}, for which there is no baseline; "
            f"choices: {', '.join(sorted(BASELINES))}"
        )
    return BASELINES[stored.plan.name]


def network_inputs(stored: StoredDataset) -> dict[str, NetworkInput]:
    """Return what the network reads of a data set, by field.

    Raises:
        DatasetError: If a field is none that a network reads.
    """
    names = stored.names("input")
    unknown = sorted(set(names) - set(PREPARE))
    if unknown or not names:
        raise DatasetError(f"{stored.folder}: no network reads {unknown or 'nothing'}")
    return {name: PREPARE[name](stored, name) for name in names}

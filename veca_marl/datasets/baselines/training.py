"""``datasets train``: several runs of a baseline, their mean and deviation, beside the paper's."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf

from veca_marl.algos.networks.encoders import Pooling
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.datasets.baselines.catalogue import Baseline, find_baseline, network_inputs
from veca_marl.datasets.baselines.learning import LearningCfg, split, train_baseline
from veca_marl.datasets.storage import DatasetError, StoredDataset
from veca_marl.version import __version__


def default_network() -> MultisenseCfg:
    """Return the network of the agents with the choices that learn the data sets faster.

    Boxes are learnt from 3200 images with an overlap of at least 0.5 in 88 % of the test set, with
    the defaults of the agents in 67 %.
    """
    return MultisenseCfg(channels=[32, 64, 64], pooling=Pooling.places, vector_features=128)


@dataclass
class TrainOptions:
    """Options of ``train``.

    Attributes:
        data: Folder of the data set; None is ``datasets/NAME``.
        epochs: Passes over the samples that are learnt from.
        runs: Runs with different seeds.
        seed: Seed of the first run; the others have the next ones.
        json: File that the scores are written to; None writes none.
        device: Device of the networks: cpu, cuda, ...
        threads: Torch threads.
        progress: A progress bar.
        learning: Numbers of the training.
        network: Sizes of the encoders, those of the agents.
    """

    data: str | None = None
    epochs: int = 50
    runs: int = 5
    seed: int = 0
    json: str | None = None
    device: str = "cpu"
    threads: int = 1
    progress: bool = True
    learning: LearningCfg = field(default_factory=LearningCfg)
    network: MultisenseCfg = field(default_factory=default_network)

    def __post_init__(self) -> None:
        for name in ("epochs", "runs", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")


@dataclass(frozen=True)
class Score:
    """One score of all runs.

    Attributes:
        values: One of each run.
        meaning: Unit, and whether higher or lower is better.
    """

    values: tuple[float, ...]
    meaning: str

    @property
    def mean(self) -> float:
        """Mean over the runs."""
        return float(np.mean(self.values))

    @property
    def deviation(self) -> float | None:
        """Standard deviation over the runs; None of one run."""
        return float(np.std(self.values, ddof=1)) if len(self.values) > 1 else None

    def __str__(self) -> str:
        spread = "" if self.deviation is None else f" +- {self.deviation:.4f}"
        return f"{self.mean:.4f}{spread}"


def run_baseline(stored: StoredDataset, options: TrainOptions) -> dict[str, Score]:
    """Return the scores of all runs, the main one first.

    Raises:
        DatasetError: If there is no baseline, or there are too few samples.
    """
    if len(stored) < 2:
        raise DatasetError(f"{stored.folder} has one sample; a test set needs at least two")
    objective = find_baseline(stored).objective
    inputs = network_inputs(stored)
    torch.set_num_threads(options.threads)
    found: dict[str, list[float]] = {name: [] for name in objective.scores}
    for run in range(options.runs):
        trained = train_baseline(
            stored,
            objective,
            inputs,
            options.network,
            options.learning,
            options.epochs,
            options.seed + run,
            options.device,
            options.progress,
        )
        for name, value in trained.scores.items():
            found[name].append(value)
    return {name: Score(tuple(values), objective.scores[name]) for name, values in found.items()}


def lines(stored: StoredDataset, baseline: Baseline, scores: Mapping[str, Score]) -> list[str]:
    """Return the scores as lines of text."""
    width = max(map(len, scores))
    table = [f"{name.ljust(width)}  {score}  ({score.meaning})" for name, score in scores.items()]
    paper = f"{'paper'.ljust(width)}  {baseline.paper}"
    return [stored.plan.name, *table, *([paper] if baseline.paper else [])]


def as_json(
    stored: StoredDataset, options: TrainOptions, scores: Mapping[str, Score], words: Sequence[str]
) -> str:
    """Return the scores with all that they depend on, as JSON."""
    train, test = split(len(stored), options.learning.test_fraction)
    content: dict[str, Any] = {
        "dataset": stored.plan.name,
        "command": shlex.join(["python", "-m", "veca_marl.datasets", "train", *words]),
        "data": {
            "command": stored.card["command"],
            "checksum": stored.card["checksum"],
            "senses": {
                key: value
                for key, value in stored.plan.config.items()
                if key not in ("dataset", "playground")
            },
        },
        "samples": {"learnt from": len(train), "test": len(test)},
        "epochs": options.epochs,
        "seeds": [options.seed + run for run in range(options.runs)],
        "learning": _plain(options.learning),
        "network": _plain(options.network),
        "versions": {"veca_marl": __version__, "torch": torch.__version__},
        "paper": find_baseline(stored).paper,
        "scores": {
            name: {
                "mean": score.mean,
                "deviation": score.deviation,
                "runs": list(score.values),
                "meaning": score.meaning,
            }
            for name, score in scores.items()
        },
    }
    return json.dumps(content, indent=2) + "\n"


def _plain(numbers: Any) -> Any:
    """Return a dataclass of numbers as plain data."""
    return OmegaConf.to_container(OmegaConf.structured(numbers), enum_to_str=True)

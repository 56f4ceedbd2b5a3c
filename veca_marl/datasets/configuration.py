"""The configuration of a data set: its numbers, the quality of the senses and the playground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import cast

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING

import veca_marl.datasets.kinds  # noqa: F401  registers all data sets
from veca_marl.config.compose import compose_other
from veca_marl.config.errors import ConfigError, one_line
from veca_marl.config.overrides import conf_dirs
from veca_marl.datasets.dataset import DATASETS, Dataset, DatasetCfg
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg

ROOT = "datasets"
"""The root in `conf/`."""


@dataclass
class DatasetConfig:
    """Everything the samples of a data set depend on, beside seed and index.

    Attributes:
        dataset: The data set and its numbers: ``+dataset=sound_localisation``.
        playground: Where samples are taken: the floor and the walls of its first room.
        senses: Quality of each sense.
    """

    dataset: DatasetCfg = MISSING
    playground: PlaygroundCfg = field(default_factory=PlaygroundCfg)
    senses: SensesCfg = field(default_factory=SensesCfg.complete)


def compose_dataset(overrides: Sequence[str]) -> DatasetConfig:
    """Return the configuration that overrides such as ``+dataset=object_recognition`` describe.

    Raises:
        ConfigError: One line that names the wrong part and the choices.
    """
    if not any(text.lstrip("+").startswith("dataset=") for text in overrides):
        raise ConfigError(f"no data set: add +dataset=NAME; choices: {', '.join(sorted(DATASETS))}")
    config = cast(DatasetConfig, compose_other(ROOT, overrides, store_schemas))
    for sense in DATASETS[config.dataset.name].senses_used:
        if not config.senses.of(sense).present:
            raise ConfigError(
                f"{config.dataset.name} needs the sense {sense}, which is not present"
            )
    return config


def make_dataset(config: DatasetConfig) -> Dataset:
    """Return what draws the samples.

    Raises:
        ConfigError: If a choice is impossible.
    """
    try:
        return DATASETS[config.dataset.name](config.dataset, config.senses, config.playground)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def store_schemas() -> None:
    """Store the schemas of the root and of all data sets, present and later ones."""
    ConfigStore.instance().store(name="datasets_schema", node=DatasetConfig)
    DATASETS.listen(_store_dataset)


def _store_dataset(name: str) -> None:
    """Store the schema of a data set, and an entry of the group if it has no preset."""
    store = ConfigStore.instance()
    store.store(group="schema/dataset", name=name, node=DATASETS[name].cfg_type)
    if not any((folder / "dataset" / f"{name}.yaml").is_file() for folder in conf_dirs()):
        entry = {"defaults": [{"/schema/dataset@_here_": name}, "_self_"]}
        store.store(group="dataset", name=name, node=entry)

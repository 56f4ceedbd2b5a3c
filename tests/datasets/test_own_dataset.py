"""A data set of a user: it is registered, made, read, and has no baseline."""

from dataclasses import dataclass

import numpy as np
import pytest

from veca_marl.datasets import DatasetError, load, make
from veca_marl.datasets.baselines.catalogue import find_baseline
from veca_marl.datasets.dataset import DATASETS, Dataset, DatasetCfg, register_dataset
from veca_marl.datasets.fields import Field, Role


@dataclass
class DiceCfg(DatasetCfg):
    name: str = "dice"
    sides: int = 6


class Dice(Dataset):
    """Rolls of a die."""

    cfg_type = DiceCfg
    senses_used = ()

    def __init__(self, cfg, senses, playground):
        self.cfg = cfg
        self.fields = {"rolled": Field((), "int64", Role.label, 1, cfg.sides, "eyes", "a roll")}

    def draw(self, rng):
        return {"rolled": np.array(rng.integers(1, self.cfg.sides + 1), np.int64)}


@pytest.fixture
def dice():
    register_dataset(Dice)
    yield
    del DATASETS["dice"]


def test_a_data_set_of_a_user_is_made_and_read(dice, tmp_path):
    make(["+dataset=dice", "dataset.sides=20"], n=300, out=tmp_path / "set")
    stored = load(tmp_path / "set", verify=True)
    assert set(stored.data["rolled"].tolist()) == set(range(1, 21))
    with pytest.raises(DatasetError, match="dice"):
        find_baseline(stored)


def test_an_input_of_any_kind_is_on_the_card(dice, tmp_path, monkeypatch):
    as_input = Field((), "int64", Role.input, 1, 6, "eyes", "a roll")
    made = Dice.__init__

    def with_input(self, *arguments):
        made(self, *arguments)
        self.fields = {"rolled": as_input}

    monkeypatch.setattr(Dice, "__init__", with_input)
    make(["+dataset=dice"], n=3, out=tmp_path / "set")
    assert "a roll" in (tmp_path / "set" / "README.md").read_text()


def test_a_sample_out_of_its_range_is_a_fault(dice, tmp_path, monkeypatch):
    monkeypatch.setattr(Dice, "draw", lambda self, rng: {"rolled": np.array(7, np.int64)})
    with pytest.raises(ValueError, match="rolled"):
        make(["+dataset=dice"], n=1, out=tmp_path / "set")


def test_two_data_sets_of_one_name_are_refused(dice):
    class Other(Dice):
        """Others."""

    with pytest.raises(ValueError, match="dice"):
        register_dataset(Other)

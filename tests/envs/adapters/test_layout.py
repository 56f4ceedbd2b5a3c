"""Layouts give data that TorchRL's checks accept, new at each step and without a copy."""

import numpy as np
import pytest
import torch
from torchrl.data import Bounded, Categorical, Composite, Unbounded

from veca_marl.envs.adapters.torchrl.fast_step import Layout


@pytest.fixture
def spec():
    team = Composite(
        observation=Composite(
            vision=Bounded(0, 255, (2, 3, 4, 4), dtype=torch.uint8), shape=(2, 3)
        ),
        reward=Unbounded((2, 3, 1)),
        shape=(2, 3),
    )
    done = Categorical(2, shape=(2, 1), dtype=torch.bool)
    return Composite(team=team, done=done, shape=(2,))


def test_the_unchecked_tensordict_is_in_the_spec(spec):
    layout = Layout(spec)
    unchecked = layout.tensordict(layout.new())
    assert spec.is_in(unchecked)
    checked = spec.zero()
    assert set(unchecked.keys(True)) == set(checked.keys(True))
    for key in checked.keys(True):
        assert type(unchecked[key]) is type(checked[key])  # tensor or tensordict with a batch
        assert unchecked[key].shape == checked[key].shape, key
        assert unchecked[key].dtype == checked[key].dtype
        assert unchecked[key].device == checked[key].device


def test_tensors_share_the_memory_of_the_arrays(spec):
    layout = Layout(spec)
    arrays = layout.new()
    tensordict = layout.tensordict(arrays)
    arrays["team"]["observation"]["vision"][1, 2] = 7
    arrays["done"][0] = True
    assert (tensordict["team", "observation", "vision"][1, 2] == 7).all()
    assert tensordict["done"].tolist() == [[True], [False]]


def test_two_steps_share_no_memory(spec):
    layout = Layout(spec)
    first, second = layout.new(), layout.new()
    assert not np.shares_memory(first["done"], second["done"])
    assert not np.shares_memory(first["team"]["reward"], second["team"]["reward"])

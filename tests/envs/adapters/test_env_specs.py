"""TorchRL's specs of senses and bodies."""

import numpy as np
import pytest
import torch
from torchrl.data import Bounded, Categorical, Unbounded

from veca_marl.envs.adapters.torchrl.env_specs import action_spec, done_spec, to_torchrl
from veca_marl.sim.sense import ArraySpec


def test_bounds_are_kept():
    spec = to_torchrl(ArraySpec((2,), np.float32, -1.0, 1.0), (4, 3))
    assert isinstance(spec, Bounded)
    assert spec.shape == (4, 3, 2)
    assert spec.dtype is torch.float32
    assert (spec.space.low == -1.0).all()
    assert (spec.space.high == 1.0).all()


def test_images_stay_bytes():
    spec = to_torchrl(ArraySpec((2, 3, 8, 8), np.uint8, 0, 255), (1, 1))
    assert spec.dtype is torch.uint8
    assert spec.is_in(torch.full((1, 1, 2, 3, 8, 8), 255, dtype=torch.uint8))


@pytest.mark.parametrize(("low", "high"), [(-np.inf, np.inf), (-8.0, np.inf), (-np.inf, 0.0)])
def test_an_array_that_lacks_a_bound_is_unbounded(low, high):
    assert isinstance(to_torchrl(ArraySpec((3,), np.float32, low, high), (1,)), Unbounded)


def test_a_choice_is_categorical():
    spec = to_torchrl(ArraySpec((), np.int64, 0, 6), (4, 3))
    assert isinstance(spec, Categorical)
    assert spec.n == 7
    assert spec.shape == (4, 3)
    assert spec.is_in(torch.full((4, 3), 6))
    assert not spec.is_in(torch.full((4, 3), 7))


def test_an_action_of_several_parts_is_a_composite():
    parts = {"move": ArraySpec((2,), np.float32, -1.0, 1.0), "voice": ArraySpec((), np.int64, 0, 4)}
    several = action_spec(parts, (4, 3))["action"]
    assert {part: leaf.shape for part, leaf in several.items()} == {
        "move": (4, 3, 2),
        "voice": (4, 3),
    }
    assert isinstance(action_spec({"move": parts["move"]}, (4, 3))["action"], Bounded)


def test_flags_are_booleans():
    flags = done_spec((4, 2))
    assert set(flags) == {"done", "terminated", "truncated"}
    assert all(flag.dtype is torch.bool and flag.shape == (4, 2, 1) for flag in flags.values())

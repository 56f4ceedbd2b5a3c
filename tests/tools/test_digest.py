"""Digests, and the comparison of two files of them."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torchrl.data import Bounded, Categorical

import veca_marl
from tools import digest
from tools.digests.catalogue import all_jobs, quick_jobs
from tools.digests.hashing import CHARACTERS, Digest
from tools.digests.plays import random_action
from tools.digests.trainings import last_state, without_times


def of(value):
    found = Digest()
    found.add("value", value)
    return found.text()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2, np.float32), np.zeros(2, np.int32)),
        (np.array([0.0]), np.array([-0.0])),
        (torch.zeros(2), torch.tensor([0.0, 1e-40])),
        (torch.zeros(2, dtype=torch.bfloat16), torch.ones(2, dtype=torch.bfloat16)),
        (1, 1.0),
        (True, 1),
        ("1", 1),
        (None, "None"),
        ([1, [2]], [1, 2]),
        ({"a": 1}, {"b": 1}),
        ([], [[]]),
    ],
)
def test_different_values_have_different_digests(one, other):
    assert of(one) != of(other)
    assert len(of(one)) == CHARACTERS


def test_the_order_of_a_mapping_does_not_count():
    assert of({"a": torch.ones(2), 3: [1]}) == of({3: [1], "a": torch.ones(2)})


def test_the_layout_of_a_tensor_in_memory_does_not_count():
    square = torch.arange(4.0).reshape(2, 2)
    assert of(square.T) == of(square.T.contiguous())
    assert of(square.T) != of(square)
    assert of(torch.tensor(True)) != of(torch.tensor(False))


def test_values_without_defined_bytes_are_refused():
    with pytest.raises(TypeError):
        of(object())


def test_random_actions_are_within_their_spec_and_seeded():
    def draw(spec, seed):
        return random_action(spec, torch.Generator().manual_seed(seed))

    bounded = Bounded(low=-1.0, high=2.0, shape=(50, 2))
    for spec in (bounded, Categorical(3, shape=(50,))):
        assert spec.is_in(draw(spec, 0))
        assert torch.equal(draw(spec, 0), draw(spec, 0))
        assert not torch.equal(draw(spec, 0), draw(spec, 1))


@dataclass(frozen=True)
class Constant:
    """An item without a game."""

    name: str
    value: int

    def measure(self, found):
        found.add(self.name, self.value)


def test_a_job_has_a_digest_for_each_item(capsys):
    digests = digest.measure((Constant("x/one", 1), Constant("x/two", 2)))
    assert list(digests) == ["x/one", "x/two"]
    assert len(set(digests.values())) == 2
    assert "x/one" in capsys.readouterr().err


def test_items_are_selected_by_name():
    one, two = Constant("x/one", 1), Constant("y/two", 2)
    assert digest.selected([(one, two), (two,)], "x/*") == [(one,)]


def test_a_file_of_digests_is_read_as_it_was_written(tmp_path):
    digests = {"x/one": "0123", "x/two": "4567"}
    (tmp_path / "file").write_text(digest.to_text(digests))
    assert digest.read(tmp_path / "file") == digests
    (tmp_path / "file").write_text("x/one\n")
    with pytest.raises(ValueError):  # noqa: PT011  the wording is free
        digest.read(tmp_path / "file")


def test_differences_are_named():
    before = {"x/a": "1", "x/b": "2", "y/c": "3"}
    assert list(digest.differences(before, before, "*")) == []
    found = list(digest.differences(before, {"x/a": "1", "x/b": "9", "x/d": "4"}, "x/*"))
    assert ["x/b" in found[0], "x/d" in found[1], len(found)] == [True, True, 2]
    found = list(digest.differences(before, {"x/a": "1", "x/b": "2"}, "*"))
    assert len(found) == 1
    assert "y/c" in found[0]


def test_names_are_unique_and_every_task_is_in_them():
    names = [item.name for job in all_jobs() for item in job]
    assert len(set(names)) == len(names)
    assert not any(" " in name for name in names)
    quick = {item.name for job in quick_jobs() for item in job}
    assert {f"rollout/{task}" for task in veca_marl.list_tasks()} <= quick <= set(names)


def test_a_run_without_checkpoint_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        last_state(tmp_path)


def test_columns_of_times_are_left_out():
    assert without_times([{"frames": 1, "frames_per_s": 2.0}]) == [{"frames": 1}]

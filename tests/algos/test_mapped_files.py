"""Files of which random rows are read: the system reads nothing ahead of them."""

from pathlib import Path

import pytest
import torch
from demonstrated import demonstrations_of_toy
from tensordict import MemoryMappedTensor, TensorDict

from veca_marl.algos.mapped_files import expect_scattered_reads
from veca_marl.algos.sac.replay import _ReservedFiles

SMAPS = Path("/proc/self/smaps")


def reads_ahead(array):
    """Return what Linux states of the mapping of an array; it says ``rr`` for random reads."""
    inside = False
    for line in SMAPS.read_text().splitlines():
        first, *words = line.split()
        if "-" in first and not first.endswith(":"):
            begin, end = (int(part, 16) for part in first.split("-"))
            inside = begin <= array.data_ptr() < end
        elif inside and first == "VmFlags:":
            return "rr" not in words
    raise AssertionError("the array is in no mapping")


pytestmark = pytest.mark.skipif(not SMAPS.is_file(), reason="only Linux states this")


def test_advice_changes_how_a_file_is_read_and_not_its_content(tmp_path):
    array = MemoryMappedTensor.from_tensor(torch.arange(9000), filename=tmp_path / "a.memmap")
    assert reads_ahead(array)
    expect_scattered_reads(array)
    assert not reads_ahead(array)
    assert torch.equal(array, torch.arange(9000))


def test_demonstrations_are_read_ahead_until_rows_are_drawn(tmp_path):
    found = demonstrations_of_toy(tmp_path)
    action = ("agents", "action")
    assert reads_ahead(found.rows[action])
    index = torch.tensor([[3, 0], [1, 3]])
    assert torch.equal(found.scattered([action], index)[action], found.rows[action][index])
    assert not reads_ahead(found.rows[action])


def test_files_of_a_replay_buffer_are_not_read_ahead(tmp_path):
    storage = _ReservedFiles(8, scratch_dir=tmp_path)
    storage.set(range(2), TensorDict({"a": torch.ones(2, 5000)}, [2]))
    assert not reads_ahead(storage._storage["a"])

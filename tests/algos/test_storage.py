"""What learning stores is stated, and refused where it does not fit."""

import errno
import mmap
import os
from pathlib import Path

import pytest
import torch
from refusals import naming

from veca_marl.algos import storage
from veca_marl.algos.files import WriteError
from veca_marl.algos.storage import (
    StorageError,
    StorageNeeded,
    check_storage,
    reserve_disk,
    reserve_memory,
    runs_that_fit,
)


@pytest.fixture
def machine(monkeypatch):
    """A machine with 10 GB of memory and 20 GB of disk space."""
    monkeypatch.setattr(storage, "available_memory", lambda: 10 * 10**9)
    monkeypatch.setattr(storage, "available_disk", lambda folder: 20 * 10**9)


def test_the_needs_of_all_teams_count_together(machine):
    one = StorageNeeded(memory_bytes=4 * 10**9, settings="algo.replay.capacity")
    assert check_storage({"red": one}) == ["replay: 4.00 GB of memory, 10.00 GB are available"]
    assert len(check_storage({"red": one, "blue": one})) == 1
    parts = ("memory", "12.00 GB", "10.00 GB", "90%", "algo.replay.capacity")
    with pytest.raises(ValueError, match=naming(*parts)):
        check_storage({"red": one, "blue": one, "green": one})


def test_disk_space_is_checked_by_folder(machine, tmp_path):
    need = StorageNeeded(disk_bytes=15 * 10**9, folder=tmp_path / "data")
    assert check_storage({"red": need}) == [
        f"replay: 15.00 GB of disk space in {tmp_path}/data, 20.00 GB are available"
    ]
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match=naming("disk", "30.00 GB", tmp_path / "data")):
        check_storage({"red": need, "blue": need})


def test_folders_on_one_disk_share_its_space(machine, tmp_path):
    red, blue = (StorageNeeded(disk_bytes=10 * 10**9, folder=tmp_path / name) for name in "ab")
    with pytest.raises(
        ValueError, match=naming("disk", "20.00 GB", tmp_path / "a", tmp_path / "b")
    ):
        check_storage({"red": red, "blue": blue})
    assert runs_that_fit([{"red": red}, {"blue": blue}]) == 1


def test_so_many_runs_fit_that_any_of_them_fit_together(machine, tmp_path, monkeypatch):
    """90 % of 10 GB of memory and of 20 GB of disk space may be used."""

    def run(memory_gb, disk_gb=0, folder=None):
        half = StorageNeeded(memory_gb * 10**9 // 2, disk_gb * 10**9, folder)
        return {"red": half, "blue": StorageNeeded(memory_gb * 10**9 // 2)}

    assert runs_that_fit([run(4)] * 3) == 2
    assert runs_that_fit([run(1), run(8), run(1)]) == 2
    assert runs_that_fit([run(1), run(8), run(0)]) == 3
    assert runs_that_fit([run(0)] * 5) == 5
    assert runs_that_fit([run(10), run(1)]) == 0
    assert runs_that_fit([run(1, 9, tmp_path)] * 3) == 2
    assert runs_that_fit([run(1, 9, tmp_path), run(1, 9, tmp_path / "b"), run(1)]) == 3
    monkeypatch.setattr(storage, "available_memory", lambda: None)
    assert runs_that_fit([run(10)] * 3) == 3


def test_nothing_is_said_where_nothing_is_stored(machine):
    assert check_storage({"red": StorageNeeded()}) == []


def test_an_unknown_size_of_memory_refuses_nothing(monkeypatch):
    monkeypatch.setattr(storage, "available_memory", lambda: None)
    assert check_storage({"red": StorageNeeded(10**15)}) == ["replay: 1000000.00 GB of memory"]


def test_a_folder_that_does_not_exist_yet_is_on_the_disk_of_its_parent(tmp_path):
    assert storage.available_disk(tmp_path / "new" / "folder") > 0


@pytest.mark.parametrize("below", ["", "below", "below/it"])
def test_a_folder_at_or_below_a_file_is_refused(tmp_path, below):
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / below
    need = StorageNeeded(disk_bytes=10, folder=folder, settings="algo.replay.folder")
    with pytest.raises(ValueError, match=naming(folder, "Not a directory", "algo.replay.folder")):
        check_storage({"red": need})


def test_a_folder_in_which_nothing_can_be_made_is_refused():
    need = StorageNeeded(disk_bytes=10, folder=Path("/proc/new"), settings="algo.replay.folder")
    with pytest.raises(ValueError, match=naming("/proc/new", "algo.replay.folder")):
        check_storage({"red": need})


def test_reserved_memory_is_taken_at_once():
    # not torch.empty: after learning in this process it may return pages that are kept resident
    array = torch.frombuffer(mmap.mmap(-1, 64 * 2**20), dtype=torch.uint8)
    before = resident_bytes()
    reserve_memory([array], "")
    assert resident_bytes() - before > 0.9 * array.nbytes


def resident_bytes():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def test_memory_that_other_programs_take_in_the_meantime_is_missed_at_once(monkeypatch):
    """Each of two runs needs 80 of 100 bytes; the other one fills its buffer at the same time."""
    left = iter(range(100, 0, -20))
    monkeypatch.setattr(storage, "available_memory", lambda: next(left))
    monkeypatch.setattr(storage, "_CHUNK", 10)
    arrays = [torch.ones(4, 10, dtype=torch.uint8), torch.ones(40, dtype=torch.uint8)]
    parts = ("memory", "0.00 GB", "algo.replay.capacity", "hydra.launcher.jobs")
    with pytest.raises(StorageError, match=naming(*parts)):
        reserve_memory(arrays, "algo.replay.capacity")
    assert [int(array.sum()) for array in arrays] == [10, 40]  # needed 50 and left 40


@pytest.mark.parametrize("call", ["posix_fallocate", "none"])
def test_reserved_disk_space_is_taken_at_once(tmp_path, monkeypatch, call):
    """By a call of the system, or by writing zeros where there is none."""
    if call == "none":
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
        monkeypatch.setattr(storage, "_CHUNK", 1000)
    file = tmp_path / "sparse"
    with file.open("wb") as opened:
        opened.truncate(10**6)
    assert file.stat().st_blocks * 512 < 10**6
    reserve_disk(file)
    assert file.stat().st_blocks * 512 >= 10**6 == file.stat().st_size


def test_a_disk_that_is_full_is_named(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", fail)
    file = tmp_path / "file"
    file.write_bytes(bytes(3_000_000))
    with pytest.raises(WriteError, match=naming(file, "No space left", "3.0 MB")):
        reserve_disk(file)

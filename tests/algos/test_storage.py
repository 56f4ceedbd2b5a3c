"""What learning stores is stated, and refused where it does not fit."""

from pathlib import Path

import pytest

from veca_marl.algos import storage
from veca_marl.algos.storage import StorageNeeded, check_storage


@pytest.fixture
def machine(monkeypatch):
    """A machine with 10 GB of memory and 20 GB of disk space."""
    monkeypatch.setattr(storage, "available_memory", lambda: 10 * 10**9)
    monkeypatch.setattr(storage, "available_disk", lambda folder: 20 * 10**9)


def test_the_needs_of_all_teams_count_together(machine):
    one = StorageNeeded(memory_bytes=4 * 10**9, settings="algo.replay.capacity")
    assert check_storage({"red": one}) == ["replay: 4.00 GB of memory, 10.00 GB are available"]
    assert len(check_storage({"red": one, "blue": one})) == 1
    message = (
        r"the replay buffers take 12.00 GB of memory, and 10.00 GB are available, "
        r"of which 90% may be used; change algo.replay.capacity"
    )
    with pytest.raises(ValueError, match=message):
        check_storage({"red": one, "blue": one, "green": one})


def test_disk_space_is_checked_by_folder(machine):
    need = StorageNeeded(disk_bytes=15 * 10**9, folder=Path("/data"))
    assert check_storage({"red": need}) == [
        "replay: 15.00 GB of disk space in /data, 20.00 GB are available"
    ]
    with pytest.raises(ValueError, match=r"take 30.00 GB of disk space in /data"):
        check_storage({"red": need, "blue": need})


def test_nothing_is_said_where_nothing_is_stored(machine):
    assert check_storage({"red": StorageNeeded()}) == []


def test_an_unknown_size_of_memory_refuses_nothing(monkeypatch):
    monkeypatch.setattr(storage, "available_memory", lambda: None)
    assert check_storage({"red": StorageNeeded(10**15)}) == ["replay: 1000000.00 GB of memory"]


def test_memory_is_limited_by_the_control_group(tmp_path):
    files = {"memory.max": "1000\n", "memory.current": "400\n"}
    for name, text in (files | {"memory.stat": "anon 300\ninactive_file 100\n"}).items():
        (tmp_path / name).write_text(text)
    assert storage._cgroup_memory(tmp_path) == 700
    (tmp_path / "memory.max").write_text("max\n")
    assert storage._cgroup_memory(tmp_path) is None
    assert storage._cgroup_memory(tmp_path / "other") is None


def test_memory_of_the_system_is_read(tmp_path):
    file = tmp_path / "meminfo"
    file.write_text("MemTotal:  99 kB\nMemAvailable:   50 kB\n")
    assert storage._system_memory(file) == 50 * 1024


def test_a_folder_that_does_not_exist_yet_is_on_the_disk_of_its_parent(tmp_path):
    assert storage.available_disk(tmp_path / "new" / "folder") > 0

"""Files are complete or absent, and errors name them."""

import os
import re
import resource
from contextlib import contextmanager

import pytest
from refusals import naming

from veca_marl.algos import files
from veca_marl.algos.files import (
    WriteError,
    left_behind,
    new_temporary,
    open_to_append,
    write_atomically,
    write_errors,
)


@contextmanager
def full_disk():
    """Limit files to 100 bytes: writes fail as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_content_is_written_and_replaced(tmp_path):
    path = tmp_path / "new" / "run.txt"
    for content in ("müde", b"\x00\xff", memoryview(b"view")):
        write_atomically(path, content)
        assert path.read_bytes() == (content.encode() if content == "müde" else bytes(content))
    assert list(path.parent.iterdir()) == [path]


def test_a_full_disk_leaves_the_file_and_no_temporary_one(tmp_path):
    path = tmp_path / "run.txt"
    write_atomically(path, "before")
    parts = (path, "File too large", "1.0 MB")
    with pytest.raises(WriteError, match=naming(*parts)), full_disk():
        write_atomically(path, b"x" * 1_000_000)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_created_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match=r"file/run\.txt.*(Not a dir|File exists)"):
        write_atomically(tmp_path / "file" / "run.txt", "content")


def test_a_folder_without_permission_is_named(tmp_path, monkeypatch):
    def refused(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(files.os, "replace", refused)
    with pytest.raises(WriteError, match=r"run\.txt.*Permission denied$"):
        write_atomically(tmp_path / "run.txt", "content")
    assert not list(tmp_path.iterdir())


def test_the_content_is_on_the_disk_before_it_replaces_the_file(tmp_path, monkeypatch):
    calls = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(files.os, name, lambda *a, n=name, r=real: (calls.append(n), r(*a))[1])
    write_atomically(tmp_path / "run.txt", "content")
    assert calls == ["fsync", "replace", "fsync"]  # the last one is that of the folder


def test_what_a_killed_process_left_is_found_by_the_name_of_the_file(tmp_path):
    path = tmp_path / "run.txt"
    left = new_temporary(path)
    left.write_text("half of the con")
    of_earlier_versions = path.with_name(".run.txt.tmp")
    for other in (of_earlier_versions, path.with_name(".notes.tmp"), path.with_name("run.txt.tmp")):
        other.touch()
    write_atomically(path, "content")
    assert path.read_text() == "content"
    assert left_behind(tmp_path, re.compile(r"run\.txt")) == sorted([left, of_earlier_versions])


def test_nothing_is_written_through_a_link(tmp_path):
    """Neither one with the name of the file, nor one with the former name of the temporary file."""
    own, path = tmp_path / "own.txt", tmp_path / "folder" / "run.txt"
    own.write_text("own")
    path.parent.mkdir()
    for link in (path, path.with_name(".run.txt.tmp")):
        link.symlink_to(own)
    with pytest.raises(WriteError, match=naming(path, "link")), write_errors(path):
        open_to_append(path)
    write_atomically(path, "content")
    assert (own.read_text(), path.read_text()) == ("own", "content")
    assert not path.is_symlink()


def test_a_temporary_file_has_a_name_that_cannot_be_foreseen(tmp_path):
    assert len({new_temporary(tmp_path / "run.txt") for _ in range(9)}) == 9

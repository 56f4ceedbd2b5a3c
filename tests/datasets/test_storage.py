"""Stored data sets: what is complete is read, and everything else is refused in one line."""

import errno
import json
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from veca_marl.algos.files import WriteError
from veca_marl.config import ConfigError
from veca_marl.datasets import DatasetError, load, replay_buffer, storage
from veca_marl.datasets import making as making_module
from veca_marl.datasets.configuration import compose_dataset, make_dataset
from veca_marl.datasets.making import make
from veca_marl.datasets.storage import CARD, PLAN, Plan, block_size

WORDS = ["+dataset=sound_localisation"]
COMMAND = "python -m veca_marl.datasets make +dataset=sound_localisation"


def made(folder, n=5, processes=1, words=WORDS, seed=0):
    return make(compose_dataset(words), folder, n, seed, processes, COMMAND, progress=False)


def content(folder):
    return {path.name: path.read_bytes() for path in sorted((folder / "data").iterdir())}


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks of two samples."""
    monkeypatch.setattr(making_module, "block_size", lambda sample_bytes: 2)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets") / "set"
    made(folder)
    return folder


@pytest.fixture
def copied(original, tmp_path):
    return shutil.copytree(original, tmp_path / "set")


def test_what_was_made_is_read(original):
    stored = load(original, verify=True)
    assert stored.data.batch_size == torch.Size([5])
    assert stored.data["waveform"].shape == (5, 2, 4410)
    assert stored.names("label") == ["direction"]
    assert not (original / PLAN).exists()
    assert sorted(p.name for p in original.iterdir()) == [CARD, "data"]


def test_tensordict_reads_the_same_arrays_itself(original):
    theirs = TensorDict.load_memmap(original / "data")
    ours = load(original).data
    assert set(theirs.keys()) == set(ours.keys())
    assert all(torch.equal(theirs[key], ours[key]) for key in ours.keys())  # noqa: SIM118


def test_a_replay_buffer_draws_each_sample_once(original):
    buffer = replay_buffer(load(original).data, batch_size=5)
    drawn = buffer.sample()
    assert sorted(drawn["distance"].tolist()) == sorted(load(original).data["distance"].tolist())
    with pytest.raises(RuntimeError):
        buffer.extend(drawn)


@pytest.mark.slow
def test_the_number_of_processes_does_not_change_a_byte(small_blocks, tmp_path):
    made(tmp_path / "one", n=7)
    made(tmp_path / "three", n=7, processes=3)
    assert content(tmp_path / "one") == content(tmp_path / "three")
    cards = [(tmp_path / name / CARD).read_bytes() for name in ("one", "three")]
    assert cards[0] == cards[1]


def test_a_larger_set_begins_with_the_smaller_one(original, tmp_path):
    made(tmp_path / "larger", n=8)
    larger, smaller = load(tmp_path / "larger").data, load(original).data
    assert torch.equal(larger["waveform"][:5], smaller["waveform"])


def test_an_interrupted_set_is_not_read_and_is_continued(small_blocks, tmp_path, monkeypatch):
    folder, whole = tmp_path / "set", tmp_path / "whole"
    made(whole, n=7)
    original_block, done = making_module.make_block, []

    def interrupted(dataset, folder, plan, block, progress=lambda: None):
        if block == 2:
            raise KeyboardInterrupt
        done.append(block)
        return original_block(dataset, folder, plan, block, progress)

    monkeypatch.setattr(making_module, "make_block", interrupted)
    with pytest.raises(KeyboardInterrupt):
        made(folder, n=7)
    with pytest.raises(DatasetError, match="not complete"):
        load(folder)
    monkeypatch.setattr(making_module, "make_block", original_block)
    assert made(folder, n=7).blocks == 2
    assert content(folder) == content(whole)
    assert made(folder, n=7).blocks == 0


@pytest.mark.slow
def test_a_killed_command_is_continued_by_the_same_command(tmp_path):
    folder = tmp_path / "set"
    words = [*WORDS, "n=600", f"out={folder}", "processes=2", "progress=false"]
    command = [sys.executable, "-m", "veca_marl.datasets", "make", *words]
    process = subprocess.Popen(command)
    deadline = time.monotonic() + 120.0
    while not list((folder / "blocks").glob("*.json")) and time.monotonic() < deadline:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    if not (folder / CARD).exists():  # it was not faster
        with pytest.raises(DatasetError, match="not complete"):
            load(folder)
    assert subprocess.run(command, check=False).returncode == 0
    made(tmp_path / "whole", n=600)
    assert content(folder) == content(tmp_path / "whole")


@pytest.mark.parametrize(
    ("words", "n", "seed", "key"),
    [
        (WORDS, 6, 0, "n="),
        (WORDS, 5, 1, "seed="),
        ([*WORDS, "senses/audio=mono"], 5, 0, "config.audio.quality="),
        (["+dataset=object_classification"], 5, 0, "name="),
    ],
)
def test_another_set_in_the_folder_is_named_and_kept(copied, words, n, seed, key):
    before = content(copied)
    with pytest.raises(ConfigError, match=key):
        made(copied, n=n, words=words, seed=seed)
    assert content(copied) == before


def test_a_set_of_which_nothing_is_complete_may_become_another_one(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(making_module, "make_block", killed)
        with pytest.raises(KeyboardInterrupt):
            made(tmp_path / "set", words=["+dataset=object_classification"])
    made(tmp_path / "set")
    assert sorted(content(tmp_path / "set")) == sorted(
        [*(f"{name}.memmap" for name in load(tmp_path / "set").plan.fields), "meta.json"]
    )


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("x")
    with pytest.raises(ConfigError, match="other files"):
        made(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_truncated_file_is_refused(copied):
    path = copied / "data" / "waveform.memmap"
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(DatasetError, match="truncated"):
        load(copied)


def test_an_altered_sample_is_found_and_named(copied):
    path = copied / "data" / "direction.memmap"
    changed = bytearray(path.read_bytes())
    changed[-1] ^= 1
    path.write_bytes(changed)
    load(copied)
    with pytest.raises(DatasetError, match=r"direction.*samples 0 to 4"):
        load(copied, verify=True)


def test_a_missing_file_and_a_link_are_refused(copied, tmp_path):
    path = copied / "data" / "distance.memmap"
    path.rename(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match="distance"):
        load(copied)
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match="no plain file"):
        load(copied)


def change_card(folder, change):
    card = json.loads((folder / CARD).read_text())
    change(card)
    (folder / CARD).write_text(json.dumps(card))


HOSTILE = {
    "another format": lambda card: card.update(format=2),
    "no format": lambda card: card.pop("format"),
    "no fields": lambda card: card.update(fields={}),
    "a path as field": lambda card: card["fields"].update({"../x": card["fields"]["direction"]}),
    "huge": lambda card: card.update(n=10**15),
    "negative": lambda card: card.update(n=-1),
    "text": lambda card: card.update(n="5"),
    "another type": lambda card: card["fields"]["direction"].update(dtype="object"),
    "another shape": lambda card: card["fields"]["direction"].update(shape=[4]),
    "no shape": lambda card: card["fields"]["direction"].update(shape=None),
    "list": lambda card: card.update(fields=[]),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_an_altered_card_is_refused_in_one_line(copied, kind):
    change_card(copied, HOSTILE[kind])
    with pytest.raises(DatasetError) as raised:
        load(copied)
    assert "\n" not in str(raised.value)


def test_altered_checksums_are_found(copied):
    change_card(copied, lambda card: card.update(checksum="0" * 64))
    with pytest.raises(DatasetError, match="altered"):
        load(copied, verify=True)
    change_card(copied, lambda card: card.update(blocks=None))
    with pytest.raises(DatasetError, match="checksums"):
        load(copied, verify=True)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"a": ' * 2000])
def test_a_card_that_is_no_json_object_is_refused(copied, text):
    (copied / CARD).write_text(text)
    with pytest.raises(DatasetError):
        load(copied)


def test_no_folder_and_an_empty_one_are_refused(tmp_path):
    with pytest.raises(DatasetError, match="no folder"):
        load(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="no data set"):
        load(tmp_path)


def test_a_full_disk_is_reported_before_anything_is_written(tmp_path, monkeypatch):
    usage = SimpleNamespace(total=9, used=8, free=1)
    monkeypatch.setattr(making_module.shutil, "disk_usage", lambda path: usage)
    with pytest.raises(ConfigError, match="MB are needed"):
        made(tmp_path / "set")


def test_a_disk_that_fills_leaves_what_is_complete(small_blocks, tmp_path, monkeypatch):
    folder, real = tmp_path / "set", making_module.write_block

    def full(folder, plan, block, arrays):
        if block < 2:
            return real(folder, plan, block, arrays)
        with monkeypatch.context() as patch:
            patch.setattr(storage.os, "fsync", no_space)
            return real(folder, plan, block, arrays)

    def no_space(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(making_module, "write_block", full)
    with pytest.raises(WriteError, match="No space left"):
        made(folder, n=7)
    monkeypatch.setattr(making_module, "write_block", real)
    assert made(folder, n=7).blocks == 2
    load(folder, verify=True)


def killed(*arguments):
    raise KeyboardInterrupt


def test_a_damaged_record_of_a_block_is_made_again(small_blocks, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    with monkeypatch.context() as patch:
        patch.setattr(making_module, "make_card", killed)
        with pytest.raises(KeyboardInterrupt):
            made(folder, n=7)
    (folder / "blocks" / "000001.json").write_text("{")
    assert made(folder, n=7).blocks == 1
    load(folder, verify=True)


def test_blocks_hold_all_samples_once():
    plan = Plan("x", 10, 0, 4, {}, {}, "0")
    rows = [row for block in range(plan.blocks) for row in plan.rows(block)]
    assert rows == list(range(10))
    assert block_size(10**9) == 1
    assert block_size(1) >= 1


def test_memory_mapped_arrays_are_bytes_of_the_samples(original):
    dataset = make_dataset(compose_dataset(WORDS))
    stored = load(original).data
    sample = dataset.sample(0, 3)
    assert all(np.array_equal(stored[key][3].numpy(), value) for key, value in sample.items())

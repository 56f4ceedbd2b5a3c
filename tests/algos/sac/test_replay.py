"""The replay buffer in memory and on disk, and in checkpoints."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict
from timed_batches import SPEC, batch_of

from veca_marl.algos.sac.config import ReplayCfg, Storage
from veca_marl.algos.sac.replay import Replay, Span, StoredKeys, storage_needed
from veca_marl.algos.specs import ArrayLayout

KEYS = StoredKeys.of("team", SPEC)
TORCHRL_INDEX = 8  # bytes; TorchRL numbers the rows
CFG = ReplayCfg(capacity=50, warm_up_frames=10, in_checkpoint=True)


def replay_of(cfg, batches):
    replay = Replay(KEYS, cfg, Span(0, 1, 3))
    for i in range(batches):
        replay.extend(batch_of(start=10.0 * i))
    return replay


def drawn(replay, seed=3):
    torch.manual_seed(seed)
    windows = replay.sample(40)
    return [
        windows.first["team", "observation", "time"],
        windows.last["team", "observation", "time"],
        windows.reward,
        windows.took_place.float(),
    ]


def restored(replay):
    """Return a copy that went through a checkpoint file."""
    file = io.BytesIO()
    torch.save(replay.state_dict(), file)
    file.seek(0)
    copy = Replay(KEYS, replay.cfg, Span(0, 1, 3))
    copy.load_state_dict(torch.load(file, weights_only=True))
    return copy


@pytest.mark.parametrize("batches", [2, 9])  # 28 rows, and a ring that is full
def test_a_restored_buffer_draws_and_grows_like_the_original(batches):
    replay = replay_of(CFG, batches)
    copy = restored(replay)
    for step in range(3):
        assert len(copy) == len(replay)
        torch.testing.assert_close(drawn(copy), drawn(replay), rtol=0, atol=0)
        for each in (replay, copy):
            each.extend(batch_of(start=500.0 + step))


def test_a_buffer_that_is_not_stored_starts_empty():
    replay = replay_of(replace(CFG, in_checkpoint=False), 2)
    assert replay.ready
    copy = restored(replay)
    assert (len(copy), copy.frames, copy.ready) == (0, replay.frames, False)


def test_memory_mapped_files_hold_the_same_and_are_removed(tmp_path):
    folder = tmp_path / "new" / "folder"
    cfg = replace(CFG, storage=Storage.memmap, folder=str(folder))
    mapped = replay_of(cfg, 9)
    assert sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) > 1000
    files = [file.stat() for file in folder.rglob("*.memmap")]
    assert len(files) > 5
    assert all(file.st_blocks * 512 >= file.st_size for file in files), "reserved"
    torch.testing.assert_close(drawn(mapped), drawn(replay_of(CFG, 9)), rtol=0, atol=0)
    del mapped
    assert list(folder.iterdir()) == []


def test_the_memory_is_taken_with_the_first_batch(monkeypatch):
    reserved = []
    monkeypatch.setattr(
        "veca_marl.algos.sac.replay.reserve_memory",
        lambda arrays, _: reserved.extend(a.nbytes for a in arrays),
    )
    replay = replay_of(CFG, 3)
    rows = TensorDict(replay.state_dict()["rows"]).values(True, True)
    assert sum(reserved) == 50 * (sum(array[0].nbytes for array in rows) + TORCHRL_INDEX)


def test_the_bytes_that_are_needed_are_those_of_the_storage():
    spec = replace(SPEC, observations={"vision": ArrayLayout((2, 3, 8, 8), "uint8", 0, 255)})
    needed = storage_needed(spec, replace(CFG, in_checkpoint=False))
    # two agents: an image, one number as action, reward, terminated and mask
    assert needed.memory_bytes == 50 * 2 * (2 * 3 * 8 * 8 + 4 + 4 + 1 + 1)
    assert storage_needed(spec, CFG).memory_bytes == 3 * needed.memory_bytes
    mapped = storage_needed(spec, replace(CFG, storage=Storage.memmap, folder="/data"))
    assert mapped.disk_bytes == needed.memory_bytes
    assert mapped.folder == Path("/data")


@pytest.mark.parametrize("length", [1, 2, 6])
def test_the_warm_up_counts_frames_however_short_episodes_are(length):
    replay = Replay(KEYS, ReplayCfg(capacity=100, warm_up_frames=24), Span(0, 1, 3))
    ends = [(world, step) for world in range(2) for step in range(length - 1, 6, length)]
    for frames in (12, 24):
        assert not replay.ready
        replay.extend(batch_of(done=ends))
        assert replay.frames == frames
    assert replay.ready


def test_the_end_of_an_episode_is_not_drawn_as_a_first_step():
    replay = replay_of(replace(CFG, warm_up_frames=0), 3)
    assert replay.sample(500).took_place[:, 0].all()

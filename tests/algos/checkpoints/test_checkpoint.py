import os
import resource
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import pytest
import torch
from fake_env import FakeEnv
from refusals import naming

from veca_marl.algos.checkpoints import CheckpointError, Checkpoints, Identity
from veca_marl.algos.specs import team_specs

CPU = torch.device("cpu")


@pytest.fixture
def identity():
    return Identity("Toy", team_specs(FakeEnv()))


@pytest.fixture
def checkpoints(tmp_path, identity):
    return Checkpoints(tmp_path / "checkpoints", identity, {"seed": 3}, keep_last=2)


def belonging_to(identity):
    return Checkpoints(None, identity, {})


def names(checkpoints):
    return sorted(path.name for path in checkpoints.folder.iterdir())


def test_a_stored_state_is_loaded_unchanged(checkpoints, identity):
    state = {"w": torch.randn(3), "n": 7, "nested": {"x": [1.5, None]}}
    found = checkpoints.load(checkpoints.save(state, 10, best=False), CPU)
    assert torch.equal(found.pop("w"), state.pop("w"))
    assert found == state


def test_the_latest_and_the_best_are_kept(checkpoints, identity):
    for frames, best in ((10, False), (20, True), (30, False), (40, False)):
        checkpoints.save({"frames": frames}, frames, best)
    assert names(checkpoints) == [
        "best.pt",
        "frames_000000000030.pt",
        "frames_000000000040.pt",
    ]
    assert checkpoints.latest().name == "frames_000000000040.pt"
    assert checkpoints.load(checkpoints.folder / "best.pt", CPU) == {"frames": 20}


def test_another_task_raises_an_error_with_both_names(checkpoints, identity):
    path = checkpoints.save({}, 10, best=False)
    with pytest.raises(CheckpointError, match=naming(path, "Toy", "Other")):
        belonging_to(replace(identity, task="Other")).load(path, CPU)


@pytest.mark.parametrize(
    ("other", "parts"),
    [
        (
            {"image": 20},
            ("vision.shape", "[2, 3, 16, 16]", "[2, 3, 20, 20]"),
        ),
        ({"senses": ("audio",)}, ("agents.observations.vision", "absent")),
        (
            {"discrete": True},
            ("agents.actions.action.discrete", "False", "True"),
        ),
        ({"agents": 2}, ("agents.agents", " 1 ", " 2 ")),
        ({"teams": ("red",)}, ("agents: ", "red: ", "absent")),
    ],
)
def test_other_specs_raise_an_error_with_the_differences(checkpoints, other, parts):
    path = checkpoints.save({}, 10, best=False)
    specs = team_specs(FakeEnv(**other))
    with pytest.raises(CheckpointError, match=naming(path, "specs", *parts)):
        belonging_to(Identity("Toy", specs)).load(path, CPU)


@contextmanager
def full_disk():
    """Limit files to 2 kB: writes fail as on a full disk.

    Not a fixture: pytest's own report, where it goes to a file, must not be written under it.
    """
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2048, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_full_disk_leaves_the_old_checkpoint_intact(checkpoints, identity):
    path = checkpoints.save({"w": torch.zeros(3)}, 10, best=True)
    before = path.read_bytes()
    parts = (path.with_name("best.pt"), "0.4 MB", path)
    with pytest.raises(CheckpointError, match=naming(*parts)), full_disk():
        checkpoints.save({"w": torch.zeros(100_000)}, 20, best=True)
    assert path.read_bytes() == before
    assert names(checkpoints) == ["best.pt", "frames_000000000010.pt"]
    assert checkpoints.latest() == path


@pytest.mark.parametrize("content", [b"", b"not a checkpoint", None])
def test_unreadable_files_are_named(tmp_path, identity, content):
    path = tmp_path / "x.pt"
    if content is None:
        torch.save({"some": "thing"}, path)
    else:
        path.write_bytes(content)
    with pytest.raises(CheckpointError, match=r"x\.pt"):
        belonging_to(identity).load(path, CPU)


def test_a_truncated_file_is_named(checkpoints, identity):
    path = checkpoints.save({"w": torch.zeros(1000)}, 10, best=False)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(CheckpointError, match=naming(path, "cut off")):
        belonging_to(identity).load(path, CPU)


def test_a_file_is_read_whose_name_the_locale_cannot_write(checkpoints, identity, tmp_path):
    """In an ASCII locale Python has surrogates for the bytes of other characters."""
    saved = checkpoints.save({"weight": torch.arange(5.0)}, 3, best=False)
    folder = tmp_path / "l\u00e4uf"
    folder.mkdir()
    shutil.copy(saved, folder / "stored.pt")
    program = (
        "import os, torch; from pathlib import Path\n"
        "from veca_marl.algos.checkpoint_files import load_file, map_checkpoint\n"
        f"path = Path(os.fsdecode({os.fsencode(folder)!r})) / 'stored.pt'\n"
        "content, verify = map_checkpoint(path)\n"
        "verify(content['state']['weight'])\n"
        "print(content['state']['weight'].tolist())\n"
        "print(load_file(path, torch.device('cpu'))['state']['weight'].tolist())"
    )
    ascii_locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | ascii_locale,
    )
    assert done.stdout.splitlines() == [str([0.0, 1.0, 2.0, 3.0, 4.0])] * 2, done.stderr


def test_a_folder_without_checkpoints_is_named(checkpoints):
    with pytest.raises(CheckpointError, match=naming("checkpoint", checkpoints.folder)):
        checkpoints.latest()


@pytest.mark.usefixtures("ctrl_c")
def test_an_interruption_is_delayed_until_the_file_is_written(checkpoints, identity, monkeypatch):
    save = torch.save

    def interrupted_save(*arguments):
        signal.raise_signal(signal.SIGINT)
        save(*arguments)

    monkeypatch.setattr(torch, "save", interrupted_save)
    with pytest.raises(KeyboardInterrupt):
        checkpoints.save({"n": 1}, 10, best=True)
    for path in (checkpoints.latest(), checkpoints.folder / "best.pt"):
        assert checkpoints.load(path, CPU) == {"n": 1}
    with pytest.raises(KeyboardInterrupt):  # and is heard at once again
        signal.raise_signal(signal.SIGINT)


def test_a_key_that_is_added_is_refused_unless_it_is_a_field_with_its_default(tmp_path, identity):
    stored = {"learner": {}, "opponent": {"blue": "expert"}, "algo": {"gamma": 0.9}}
    path = Checkpoints(tmp_path, identity, stored).save({}, 10, best=False)

    def load(config):
        fields = ("algo.clip", "new")
        return Checkpoints(tmp_path, identity, config, is_default=fields.__contains__).load(
            path, CPU
        )

    load(stored | {"algo": {"gamma": 0.9, "clip": 0.2}, "new": 1})
    with pytest.raises(CheckpointError, match=naming("learner.red", "absent", "0.5")):
        load(stored | {"learner": {"red": {"gamma": 0.5}}})
    with pytest.raises(CheckpointError, match=naming("opponent.red", "absent", "idle")):
        load(stored | {"opponent": {"blue": "expert", "red": "idle"}})


def test_lists_of_mappings_are_compared_element_by_element(tmp_path, identity):
    """Props that got a field since a run was stored are the same props."""
    props = [{"name": f"prop {number}", "size_m": [1.0, 2.0]} for number in range(200)]
    stored = {"playground": {"props": props}, "seed": 3}
    path = Checkpoints(tmp_path, identity, stored).save({}, 10, best=False)

    def load(props):
        config = {"playground": {"props": props}, "seed": 3}
        return Checkpoints(tmp_path, identity, config).load(path, CPU)

    newer = [{**prop, "partition": False} for prop in props]
    assert load(newer) == {}
    with pytest.raises(CheckpointError) as refusal:
        load([*newer[:7], {**newer[7], "size_m": [1.0, 3.0]}, *newer[8:]])
    message = str(refusal.value)
    assert all(part in message for part in ("playground.props.7.size_m", "2.0", "3.0"))
    assert message.count("playground") == 1
    with pytest.raises(CheckpointError, match=naming("playground.props", "200", "199")):
        load(newer[1:])


def test_a_message_names_some_of_many_differences_and_their_number(tmp_path, identity):
    stored = {f"key {number:03}": number for number in range(100)}
    path = Checkpoints(tmp_path, identity, stored).save({}, 10, best=False)
    with pytest.raises(CheckpointError, match=naming("key 000", "92 more")) as refusal:
        Checkpoints(tmp_path, identity, dict.fromkeys(stored, -1)).load(path, CPU)
    assert len(str(refusal.value)) < 1000

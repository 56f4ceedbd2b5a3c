"""Folders of memory-mapped replay buffers."""

import subprocess
import sys

import pytest
from paths import ROOT

from veca_marl.algos.sac.replay import make_scratch_folder

MAKE = (
    "import os, pathlib, signal, sys; sys.path.insert(0, sys.argv[2]);"
    "from veca_marl.algos.sac.replay import make_scratch_folder;"
    "print(make_scratch_folder(pathlib.Path(sys.argv[1])), flush=True);"
)


@pytest.mark.slow
def test_the_folder_of_a_killed_process_is_removed_by_the_next(tmp_path):
    killed = subprocess.run(
        [sys.executable, "-c", f"{MAKE} os.kill(os.getpid(), signal.SIGKILL)", tmp_path, ROOT],
        capture_output=True,
        text=True,
        check=False,
    )
    (left,) = tmp_path.iterdir()
    assert str(left) == killed.stdout.strip()
    own = make_scratch_folder(tmp_path)
    assert list(tmp_path.iterdir()) == [own]
    assert make_scratch_folder(tmp_path).exists()
    assert own.exists(), "of a process that is running"


def test_folders_of_others_stay(tmp_path):
    names = ["veca_marl_replay_elsewhere_1_x", "other"]
    for name in names:
        (tmp_path / name).mkdir()
    own = make_scratch_folder(tmp_path / "new")
    make_scratch_folder(tmp_path)
    assert own.parent == tmp_path / "new"
    assert all((tmp_path / name).exists() for name in names)

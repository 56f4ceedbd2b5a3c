"""The commands of the Dockerfile, tried without Docker."""

import json
import re
import shlex
import shutil
import subprocess
import sys

import pytest
from paths import ROOT

import veca_marl
from veca_marl.serve.command import main

LINES = (ROOT / "Dockerfile").read_text().splitlines()


def instructions(name):
    return [line.removeprefix(name + " ") for line in LINES if line.startswith(name + " ")]


@pytest.mark.slow
def test_what_is_copied_suffices_to_install_and_to_compile(tmp_path):
    for copied in instructions("COPY"):
        *sources, target = shlex.split(copied)
        folder = tmp_path / target.strip("/")
        for source in sources:
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, folder, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                folder.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / source, folder)
    (installed,) = (run for run in instructions("RUN") if "pip install" in run)
    assert '"/veca[remote]"' in installed
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--wheel-dir", str(tmp_path), str(tmp_path / "veca")], check=True)
    assert list(tmp_path.glob("veca_marl-*.whl"))
    assert (tmp_path / "veca" / "scripts" / "compile_kernels.py").is_file()


@pytest.mark.slow
def test_its_command_serves_a_client_with_a_key(tmp_path):
    (entry,), (words,) = (map(json.loads, instructions(name)) for name in ("ENTRYPOINT", "CMD"))
    keys = tmp_path / "keys"
    assert main([f"keys={keys}", "new_client=trainer"]) == 0
    words = [word.replace("0.0.0.0:5555", "127.0.0.1:*") for word in words]
    words = [f"keys={keys}" if word == "keys=/keys" else word for word in words]
    server = subprocess.Popen(
        [sys.executable, *entry[1:], *words], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    try:
        address = re.search(r"tcp://127\.0\.0\.1:\d+", server.stdout.readline()).group()
        env = veca_marl.connect(address, key=keys / "trainer.key.json", worlds=2, seed=0)
        assert env.rollout(2).batch_size == (2, 2)
        env.close()
    finally:
        server.terminate()
        server.communicate()

"""The wheel, installed outside the checkout: it contains `conf/`, makes environments and trains."""

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from veca_marl.conf_dir import conf_dir

ROOT = Path(__file__).resolve().parent.parent
SMALL = ["+experiment=smoke", "senses/vision=blind", "log=silent", "total_frames=128"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--wheel-dir", str(folder), str(ROOT)], check=True)
    return next(folder.glob("veca_marl-*.whl"))


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """The interpreter of an environment with the wheel; its dependencies are those of the tests."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps"]
    subprocess.run([*pip, str(wheel)], check=True)
    own = next(folder.glob("lib/python*/site-packages"))
    (own / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return python


def run(python, *arguments, cwd):
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [str(python), *arguments]
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


def test_the_wheel_contains_every_configuration_file(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    expected = {p.relative_to(conf_dir()).as_posix() for p in conf_dir().rglob("*.yaml")}
    assert expected
    assert {n.removeprefix("veca_marl/conf/") for n in names if n.endswith(".yaml")} == expected
    assert not [n for n in names if n.startswith(("tests/", "conf/", "experiments/"))]


def test_list_tasks_and_make_work_outside_the_checkout(python, tmp_path):
    code = (
        "import veca_marl; print(veca_marl.__file__);"
        "print(*veca_marl.list_tasks());"
        "env = veca_marl.make('KickTheBall', senses={'vision': 'blind'}, seed=0);"
        "print(env.rollout(3).shape)"
    )
    done = run(python, "-c", code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    where, tasks, shape = done.stdout.splitlines()
    assert Path(where).is_relative_to(python.parent.parent)
    assert "KickTheBall" in tasks.split()
    assert shape == "torch.Size([1, 3])"


def test_the_console_script_trains_outside_the_checkout(python, tmp_path):
    script = python.parent / "veca-train"
    done = run(python, str(script), *SMALL, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "metrics.csv").is_file()
    assert list((tmp_path / "run" / "checkpoints").iterdir())

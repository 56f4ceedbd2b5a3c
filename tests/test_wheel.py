"""The wheel, installed outside the checkout: it contains `conf/`, makes environments and trains."""

import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from hatch_build import addresses, with_absolute_links
from veca_marl.plugins import conf_dir

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


def test_the_wheel_contains_every_configuration_file(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    expected = {p.relative_to(conf_dir()).as_posix() for p in conf_dir().rglob("*.yaml")}
    assert expected
    assert {n.removeprefix("veca_marl/conf/") for n in names if n.endswith(".yaml")} == expected
    assert not [n for n in names if n.startswith(("tests/", "tools/", "conf/", "experiments/"))]


def test_the_wheel_contains_the_viewer_of_episodes(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    web = "veca_marl/runs/episode_page/web/"
    expected = {p.name for p in (ROOT / web).iterdir()}
    assert {"template.html", "three.module.min.js", "LICENSE.three"} <= expected
    assert {n.removeprefix(web) for n in names if n.startswith(web)} == expected


def test_the_wheel_contains_the_policies_of_the_zoo(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    folder = "veca_marl/zoo/policies/"
    stored = {n.removeprefix(folder) for n in names if n.startswith(folder)}
    assert stored == {path.name for path in (ROOT / folder).iterdir()}
    assert "veca_marl/zoo/command.py" in names


PROGRAM = """
import gymnasium, runpy, sys
env = gymnasium.make("veca_marl:veca_marl/KickTheBall-v0", senses={"vision": "blind"})
env.reset(seed=0)
import veca_marl
print(veca_marl.__file__)
print(*veca_marl.list_tasks())
print(veca_marl.make("KickTheBall", senses={"vision": "blind"}, seed=0).rollout(3).shape)
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.mark.slow
def test_it_makes_environments_and_trains_outside_the_checkout(python, tmp_path):
    """In one process: a Gymnasium id with its module, `make`, and the console script."""
    script = python.parent / "veca-train"
    words = [str(script), *SMALL, "hydra.run.dir=run"]
    program = f"import sys; sys.argv = {words!r}\n{PROGRAM}"
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [str(python), "-W", "ignore", "-c", program]
    done = subprocess.run(
        command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    where, tasks, shape, *_ = done.stdout.splitlines()
    assert Path(where).is_relative_to(python.parent.parent)
    assert "KickTheBall" in tasks.split()
    assert shape == "torch.Size([1, 3])"
    assert (tmp_path / "run" / "metrics.csv").is_file()
    assert list((tmp_path / "run" / "checkpoints").iterdir())


def test_the_readme_of_a_release_has_absolute_links_and_addresses():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    address = "https://example.org/owner/name"
    released = with_absolute_links(readme, address, "1.2.3")
    assert "![Both eyes of an agent" in released
    assert f"]({address}/raw/v1.2.3/docs/images/perception.png)" in released
    assert f"]({address}/blob/v1.2.3/docs/tasks/gallery.md)" in released
    targets = re.findall(r"\]\(([^)]+)\)", released)
    assert len(targets) == len(re.findall(r"\]\(([^)]+)\)", readme))
    assert all(target.startswith("https://") for target in targets)
    for target in targets:
        path = target.removeprefix(f"{address}/blob/v1.2.3/").removeprefix(f"{address}/raw/v1.2.3/")
        assert path.startswith("https://") or (ROOT / path.partition("#")[0]).exists()


def test_the_addresses_of_a_release_lead_to_files():
    links = addresses("https://example.org/owner/name", "1.2.3")
    assert {"Homepage", "Source", "Documentation", "Changelog", "Issues"} == set(links)
    for name in ("Documentation", "Changelog"):
        assert (ROOT / links[name].partition("/v1.2.3/")[2]).exists()

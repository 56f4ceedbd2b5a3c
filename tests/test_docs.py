"""The pages of tasks and of the body say what the docstrings and the data say."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from veca_marl.api import list_tasks
from veca_marl.envs.core.task import find_task
from veca_marl.sim.body.anatomy.skeleton import limit_sources

ROOT = Path(__file__).resolve().parent.parent


def load_script():
    spec = importlib.util.spec_from_file_location("make_docs", ROOT / "scripts" / "make_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", list_tasks())
def test_the_page_of_a_task_is_that_of_its_docstring(name):
    page = (ROOT / "docs" / "tasks" / f"{name}.md").read_text(encoding="utf-8")
    assert page == load_script().task_page(find_task(name)), "run make pages"


def test_the_tables_of_the_body_are_those_of_the_data():
    page = (ROOT / "docs" / "reference" / "body.md").read_text(encoding="utf-8")
    assert page == load_script().body_page(page), "run make pages"
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    bones = [row for row in rows if " mm, " in row]
    joints = [row for row in rows if " N m " in row]
    # 5 bones and 12 joints in the middle, 21 and 35 on each side
    assert (len(bones), len(joints)) == (5 + 21, 12 + 35)


def test_every_range_of_motion_names_its_source_and_the_page_explains_it():
    page = (ROOT / "docs" / "reference" / "body.md").read_text(encoding="utf-8")
    sources = {source for both in limit_sources() for source in both}
    assert sources == set(re.findall(r"\*\*(\w+)\*\*", page.split("come from")[1]))


def test_every_preset_of_the_body_is_on_its_page():
    page = (ROOT / "docs" / "reference" / "body.md").read_text(encoding="utf-8")
    presets = {path.stem for path in (ROOT / "veca_marl" / "conf" / "body").glob("*.yaml")}
    table = page.split("## Which bodies")[1].split("##")[0]
    assert presets <= set(re.findall(r"`(\w+)`", table))


def test_the_site_builds_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-q", "--fail-on-warning", "--keep-going"]
    command += ["-b", "html", "-d", tmp_path / "doctrees", ROOT / "docs", tmp_path / "html"]
    build = subprocess.run(command, capture_output=True, text=True, check=False)
    assert build.returncode == 0, build.stderr
    assert (tmp_path / "html" / "api" / "veca_marl.html").exists()

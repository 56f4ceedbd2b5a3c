"""The code of the guides runs, their links resolve, and their commands exist."""

import pkgutil
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from composed import compose

from veca_marl.bench.command import BenchOptions
from veca_marl.config.command_line import CommandLine
from veca_marl.envs.core.task import TASKS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
WRITTEN = [
    page
    for folder in (".", "getting_started", "concepts", "guides", "reference", "tasks")
    for page in sorted((DOCS / folder).glob("*.md"))
    if page.name != "changelog.md"
]
READMES = [*sorted((ROOT / "experiments").rglob("README.md")), ROOT / "tools" / "README.md"]
CHANGELOG = ROOT / "CHANGELOG.md"  # names what there was
PYTHON = re.compile(r"^ *```python\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
NEEDS_MORE = re.compile(r"\.\.\.|<|RUN|my_package|FindBeacon|launcher|sweeper|glob|run=|resume=")
RUN_BY_OTHERS = "other_libraries.md"  # tests/test_adapter_guides.py: each block by itself

RUN_BLOCKS = """
import pathlib, re, sys
blocks = re.compile(sys.argv[1], re.MULTILINE | re.DOTALL)
for page in map(pathlib.Path, sys.argv[2:]):
    names = {"__name__": page.stem}
    for number, block in enumerate(blocks.findall(page.read_text(encoding="utf-8"))):
        print(f"running block {number} of {page.name}", flush=True)
        exec(compile(block, f"{page.name}[{number}]", "exec"), names)
"""


def text_of(page):
    return page.read_text(encoding="utf-8").replace("\\\n", " ")


def commands(name):
    """Return page and arguments of the shown commands that need no run, plug-in or launcher."""
    shown = [
        (page.name, line.split("#")[0].strip())
        for page in [*WRITTEN, *READMES]
        for line in re.findall(rf"^python -m veca_marl\.{name} (.+)$", text_of(page), re.MULTILINE)
    ]
    return [(p, line) for p, line in shown if not NEEDS_MORE.search(line)]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), commands("train"))
def test_what_the_training_commands_choose_can_be_chosen(page, line):
    choices = [word for word in shlex.split(line) if word != "-m" and "hydra." not in word]
    for combination in combinations(choices):
        assert compose(combination).task.name


def combinations(choices):
    """Return the override lists of a sweep; its first and last values stand for all."""
    first, last = [], []
    for text in choices:
        key, _, values = text.partition("=")
        swept = values if "[" not in values else ""
        first.append(f"{key}={swept.split(',')[0]}" if swept else text)
        last.append(f"{key}={swept.split(',')[-1]}" if swept else text)
    return [first] if first == last else [first, last]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), commands("bench"))
def test_what_the_bench_commands_choose_can_be_chosen(page, line):
    for options, overrides in CommandLine("bench", BenchOptions, "").jobs(shlex.split(line)):
        tasks = TASKS if options.bench.tasks == ["all"] else options.bench.tasks
        for task in tasks or [None]:
            assert compose([*overrides, *([f"+task={task}"] if task else [])]).task.name


@pytest.mark.slow
def test_the_code_of_the_pages_runs(tmp_path):
    pages = [p for p in WRITTEN if PYTHON.search(text_of(p)) and p.name != RUN_BY_OTHERS]
    assert {"add_a_task.md", "add_a_sense.md", "first_steps.md"} <= {page.name for page in pages}
    # in a process of its own: the pages register tasks, which stay registered
    command = [sys.executable, "-c", RUN_BLOCKS, PYTHON.pattern, *map(str, pages)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "page", [*WRITTEN, *READMES, CHANGELOG], ids=lambda p: str(p.relative_to(ROOT))
)
def test_links_lead_to_files(page):
    generated = {DOCS / "experiments": ROOT / "experiments"}  # docs/conf.py copies it
    for link in re.findall(r"\]\((?!https?:)([^)#\s]+)", text_of(page)):
        target = (page.parent / link).resolve()
        for copy, original in generated.items():
            if target.is_relative_to(copy):
                target = original / target.relative_to(copy)
        assert target.exists(), f"{page.name} links to {link}"


@pytest.mark.parametrize("page", [*WRITTEN, *READMES], ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_and_scripts_of_commands_exist(page):
    for module in re.findall(r"python -m ((?:veca_marl|tools|experiments)[\w.]*)", text_of(page)):
        assert find_spec(module), module
    for script in re.findall(r"python ((?:scripts|experiments)/[\w/]+\.py)", text_of(page)):
        assert (ROOT / script).exists(), script


@pytest.mark.parametrize("page", [*WRITTEN, *READMES], ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_that_pages_name_exist(page):
    for path in re.findall(
        r"`((?:veca_marl|tests|conf|scripts|tools)/[\w/]+\.\w+)`", text_of(page)
    ):
        assert (ROOT / path).exists(), path
    for name in re.findall(r"`(veca_marl(?:\.[a-z_0-9]+)+)", text_of(page)):
        pkgutil.resolve_name(name)

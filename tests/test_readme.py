"""The commands of the README exist and their choices can be composed."""

import re
import subprocess
from pathlib import Path

import pytest
from composed import compose

from veca_marl.bench.command import BenchOptions
from veca_marl.config.command_line import CommandLine

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
TRAIN = re.findall(r"^python -m veca_marl\.train (.+)$", README, re.MULTILINE)
BENCH = re.findall(r"^python -m veca_marl\.bench (.+)$", README, re.MULTILINE)


def dry_run(target: str) -> str:
    command = ["make", "--dry-run", "--always-make", target]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_the_commands_are_there():
    assert len(TRAIN) >= 3
    assert BENCH


@pytest.mark.parametrize("overrides", TRAIN)
def test_what_the_training_commands_choose_can_be_chosen(overrides):
    choices = [word for word in overrides.split() if word not in ("-m", "--multirun")]
    assert compose(choices).task.name


@pytest.mark.parametrize("arguments", BENCH)
def test_the_bench_takes_its_arguments(arguments):
    for _, overrides in CommandLine("bench", BenchOptions, "").jobs(arguments.split()):
        assert compose(overrides).task.name


def test_make_train_makes_an_environment_installs_and_trains():
    lines = dry_run("train")
    positions = [
        lines.index(part)
        for part in ("make_venv.sh", "pip install", "-m veca_marl.train +task=KickTheBall")
    ]
    assert positions == sorted(positions)


@pytest.mark.parametrize(
    "part",
    ["make_venv.sh", "'.[test]'", "ruff check", "ruff format --check", "mypy", "lint-imports"],
)
def test_make_test_checks_everything(part):
    lines = dry_run("test")
    assert part in lines
    assert lines.index(part) < lines.index("pytest")


@pytest.mark.parametrize("link", re.findall(r"\]\(([^)#:]+)\)", README))
def test_links_lead_somewhere(link):
    assert (ROOT / link).exists()

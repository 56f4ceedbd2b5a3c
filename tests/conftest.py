"""Options and fixtures of all tests."""

import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "helpers" / "moved_seeds"))

from seed_offset import move_seeds

# they take longest: with several test processes they must not be left for the end
LONGEST = (
    "test_notebooks.py",
    "test_wheel.py",
    "test_plugins.py",
    "test_guides.py",
    "test_killed_runs.py",
    "test_broken_runs.py",
)


def pytest_addoption(parser):
    """Add ``--seed-offset=K``."""
    parser.addoption(
        "--seed-offset",
        type=int,
        default=0,
        metavar="K",
        help="move every seed of the tests and of their child processes; leaves out golden tests",
    )


def pytest_configure(config):
    """Move the seeds before any test module is imported."""
    move_seeds(config.getoption("--seed-offset"))


def pytest_report_header(config):
    """Name the offset, with which a failure can be repeated."""
    return f"seed offset: {config.getoption('--seed-offset')}"


def pytest_terminal_summary(terminalreporter, exitstatus, config):
    """Name the offset beside the failures, where it is read."""
    offset = config.getoption("--seed-offset")
    if offset and exitstatus:
        terminalreporter.write_line(f"seeds were moved: --seed-offset={offset}", red=True)


@pytest.hookimpl(tryfirst=True)  # before tests are selected by their marks
def pytest_collection_modifyitems(config, items):
    """Run the longest tests first; leave out stored bytes with moved seeds."""
    items.sort(key=lambda item: item.path.name not in LONGEST)
    if config.getoption("--seed-offset") == 0:
        return
    golden = [item for item in items if item.get_closest_marker("golden")]
    config.hook.pytest_deselected(items=golden)
    items[:] = [item for item in items if item not in golden]


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also in a background job, in which shells ignore SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

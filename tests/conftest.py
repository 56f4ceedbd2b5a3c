"""Fixtures of all tests."""

import signal

import pytest

# they take longest: with several test processes they must not be left for the end
LONGEST = (
    "first_light.ipynb",
    "train_in_a_notebook.ipynb",
    "test_wheel.py",
    "test_plugins.py",
    "test_guides.py",
    "test_killed_runs.py",
    "test_broken_runs.py",
)


def pytest_collection_modifyitems(items):
    """Run the longest tests first."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also in a background job, in which shells ignore SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

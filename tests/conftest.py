"""Fixtures of all tests."""

import signal

import pytest


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also in a background job, in which shells ignore SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

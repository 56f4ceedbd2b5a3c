"""What all tests share."""

import signal

import pytest


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also in a background job, which a shell makes deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

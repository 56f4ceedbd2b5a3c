"""What all tests share."""

import hashlib
import signal
from pathlib import Path

import pytest

SIM = Path(__file__).resolve().parent.parent / "veca_marl" / "sim"


def pytest_configure(config):
    """Forget compiled kernels when the simulator changed.

    numba looks at the file of a kernel alone, not at those of the kernels it calls: after an edit
    the callers in other files would go on with the old code, and the tests with them.
    """
    if hasattr(config, "workerinput"):  # a worker of pytest-xdist: the controller has done it
        return
    sources = sorted(SIM.rglob("*.py"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    stamp = SIM / "__pycache__" / "tested-sources.txt"
    if stamp.exists() and stamp.read_text() == digest:
        return
    for cached in (*SIM.rglob("*.nbi"), *SIM.rglob("*.nbc")):
        cached.unlink(missing_ok=True)
    stamp.parent.mkdir(exist_ok=True)
    stamp.write_text(digest)


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also in a background job, which a shell makes deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

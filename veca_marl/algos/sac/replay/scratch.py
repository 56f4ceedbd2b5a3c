"""Folders for memory-mapped replay buffers, which do not outlive their run for long."""

from __future__ import annotations

import os
import shutil
import socket
from pathlib import Path
from tempfile import mkdtemp

_PREFIX = "veca_marl_replay_"


def make_scratch_folder(parent: Path) -> Path:
    """Create a folder for the files of one replay buffer.

    Folders of processes of this machine that have ended without removing theirs (killed, out of
    memory) are removed before.

    Args:
        parent: Where it is created; created if absent.
    """
    parent.mkdir(parents=True, exist_ok=True)
    owner = f"{_PREFIX}{socket.gethostname()}_"
    for folder in parent.glob(f"{owner}*"):
        process = folder.name.removeprefix(owner).partition("_")[0]
        if process.isdigit() and not _is_running(int(process)):
            shutil.rmtree(folder, ignore_errors=True)
    return Path(mkdtemp(prefix=f"{owner}{os.getpid()}_", dir=parent))


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # of another user
        return True
    return True

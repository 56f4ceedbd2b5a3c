"""Compiled kernels are used again only as long as no source of the simulator has changed.

numba keeps a compiled kernel until its own file changes. What it calls in other files is compiled
into it, so that after an edit or an update there it would go on with the old code, and say nothing.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

_STAMP = "kernel-sources.txt"


def forget_stale_kernels(sources: Path) -> None:
    """Delete what numba compiled of a folder's sources, if any of them is not as it was then.

    Where the folder cannot be written, or `NUMBA_CACHE_DIR` is set, numba keeps kernels elsewhere,
    and those are not looked at.

    Args:
        sources: The folder of the sources; its `__pycache__` gets a note of what they were.
    """
    if not os.access(sources, os.W_OK):
        return
    digest = _digest(sources)
    stamp = sources / "__pycache__" / _STAMP
    if stamp.exists() and stamp.read_text() == digest:
        return
    for kernel in (*sources.rglob("*.nbi"), *sources.rglob("*.nbc")):
        kernel.unlink(missing_ok=True)
    # last: another process that starts meanwhile must not find the note beside old kernels
    stamp.parent.mkdir(exist_ok=True)
    stamp.write_text(digest)


def _digest(sources: Path) -> str:
    """Of all sources, with their names."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob("*.py")):
        digest.update(path.relative_to(sources).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()

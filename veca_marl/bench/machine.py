"""The machine and the commit that a measurement was made on."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path

from veca_marl.runs.provenance import checkout_commit
from veca_marl.version import __version__

_PACKAGES = ("numpy", "numba", "torch", "torchrl", "pybullet")


def machine() -> dict[str, str | int | float | None]:
    """Return the commit, the machine and the versions of packages."""
    return {
        "veca_marl": __version__,
        "commit": checkout_commit(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
    }


def machine_line(clock: str = "processor time of one thread") -> str:
    """Return the same as text of one line, without the packages.

    Args:
        clock: What is measured.
    """
    found = machine()
    return (
        f"veca_marl {found['veca_marl']}, commit {found['commit'] or 'unknown'}; "
        f"{found['processor']}, {found['cores']} cores, load {found['load']:.1f}; "
        f"{clock}"
    )


def _processor() -> str:
    """Return the model of the processor where Linux tells it, else the architecture."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()

"""Where a run comes from: command line, commit or version, packages."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from veca_marl.version import __version__

_PACKAGES = ("torch", "torchrl", "tensordict", "pybullet", "numpy", "numba")


def provenance(overrides: Sequence[str]) -> dict[str, object]:
    """Return what `provenance.json` of a run contains."""
    packages = {"veca_marl": __version__}
    return {
        "command": sys.orig_argv,
        "overrides": list(overrides),
        "commit": checkout_commit(),
        "python": platform.python_version(),
        "packages": packages | {name: version(name) for name in _PACKAGES},
    }


def checkout_commit(package: Path = Path(__file__).parents[1]) -> str | None:
    """Return the commit of the checkout that the package lies in, with `-dirty` if it was changed.

    None for an installed package, also where its environment lies inside another repository: the
    package has to lie directly in the top folder of the repository and be tracked by it.

    Args:
        package: The folder of the package.
    """
    top = _git(package, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != package.parent.resolve():
        return None
    if _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    return _git(package, "describe", "--always", "--abbrev=40", "--dirty", "--exclude", "*")


def _git(folder: Path, *arguments: str) -> str | None:
    """Return the output of a git command; None if it fails or git is not installed."""
    environment = {name: text for name, text in os.environ.items() if not name.startswith("GIT_")}
    try:
        done = subprocess.run(
            ["git", *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()

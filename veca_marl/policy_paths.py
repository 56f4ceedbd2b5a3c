"""Names of stored policies: a run, a checkpoint, or an entry of the zoo."""

from __future__ import annotations

from pathlib import Path

ZOO = "zoo/"
"""Begins the name of a policy that this package ships, such as ``zoo/KickTheBall``."""

SUFFIX = ".safetensors"
_POLICIES = Path(__file__).parent / "zoo" / "policies"


def zoo_names() -> list[str]:
    """Return the names of the policies that this package ships, without ``zoo/``."""
    return sorted(path.stem for path in _POLICIES.glob(f"*{SUFFIX}"))


def zoo_file(name: str) -> Path:
    """Return the file of a policy of the zoo.

    Args:
        name: Its name, without ``zoo/``.

    Raises:
        ValueError: If there is none; the message lists those there are.
    """
    if name not in zoo_names():
        choices = ", ".join(ZOO + each for each in zoo_names()) or "none yet"
        raise ValueError(f"no policy {ZOO}{name}; choices: {choices}")
    return _POLICIES / f"{name}{SUFFIX}"


def policy_path(text: str | Path) -> Path:
    """Return the path of a stored policy.

    Args:
        text: A name of the zoo (``zoo/KickTheBall``), the folder of a run, or a checkpoint. A
            folder ``zoo`` of the working directory comes first.

    Raises:
        ValueError: If there is no such name in the zoo.
    """
    path = Path(text)
    named = str(text)
    return path if path.exists() or not named.startswith(ZOO) else zoo_file(named[len(ZOO) :])

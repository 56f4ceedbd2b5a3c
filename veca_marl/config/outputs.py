"""Checks of the places that a command writes to, made before it starts to work."""

from __future__ import annotations

import os
from pathlib import Path

from veca_marl.config.errors import ConfigError


def check_file(path: str | Path, option: str) -> Path:
    """Return a file that is to be written.

    Args:
        path: The file; it may exist, and its folders need not.
        option: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If it is a folder, or no file can be written there.
    """
    file = Path(path)
    if file.is_dir():
        raise ConfigError(f"{option}={path} is a folder; give a file")
    _check_parent(file.parent, f"{option}={path}")
    if file.exists() and not os.access(file, os.W_OK):
        raise ConfigError(f"{option}={path} cannot be written: no permission to change it")
    return file


def check_folder(path: str | Path, option: str) -> Path:
    """Return a folder in which files are to be written.

    Args:
        path: The folder; it need not exist.
        option: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If it is a file, or no folder can be made there.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"{option}={path} is a file; give a folder")
    _check_parent(folder, f"{option}={path}")
    return folder


def _check_parent(folder: Path, given: str) -> None:
    """Raise `ConfigError` unless files can be made in `folder`, or it can be made itself."""
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise ConfigError(f"{given} cannot be written: {existing} is not a folder")
    if not os.access(existing, os.W_OK):
        raise ConfigError(f"{given} cannot be written: no permission to write in {existing}")

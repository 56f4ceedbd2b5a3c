"""Plug-ins: packages that add tasks, experts, bodies, algorithms, presets and experiments.

A plug-in is a package that registers its entries when it is imported. Its configuration files lie
in its folder `conf`, or in the folder that its attribute `CONF_DIR` names, with the same groups as
those of this project (`task`, `playground`, `senses/audio`, `experiment`, ...). There are two ways
to load it: an entry point of the group `veca_marl.plugins`, which names the package and is loaded
with `veca_marl`, and `plugins=[my_package]` on the command line or in `veca_marl.make`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from veca_marl.registry import Registry

GROUP = "veca_marl.plugins"


class PluginError(ValueError):
    """A plug-in cannot be loaded; the message is one line that names it and the reason."""


@dataclass(frozen=True)
class Plugin:
    """A loaded plug-in.

    Attributes:
        name: Dotted name of its module.
    """

    name: str

    @property
    def conf(self) -> Path | None:
        """The folder of its configuration files; None if it has none.

        Raises:
            PluginError: If `CONF_DIR` of the module is not a folder.
        """
        module = sys.modules[self.name]
        declared = getattr(module, "CONF_DIR", None)
        if declared is None:
            folders = [Path(path) / "conf" for path in getattr(module, "__path__", ())]
            return next((folder for folder in folders if folder.is_dir()), None)
        folder = Path(declared)
        if not folder.is_dir():
            raise PluginError(f"plug-in {self.name!r}: its CONF_DIR {folder} is not a folder")
        return folder


PLUGINS: Registry[Plugin] = Registry("plug-in")


def load_plugins(names: Sequence[str] = ()) -> None:
    """Import the installed plug-ins and those named; each once.

    Args:
        names: Dotted names of packages that can be imported.

    Raises:
        PluginError: If one cannot be imported, or registers a name that is taken.
    """
    for entry_point in _entry_points(_state_of_path()):
        _load(_module_of(entry_point), _source_of(entry_point))
    for name in names:
        _load(name, f"plugins=[{name}]")


def _state_of_path() -> tuple[tuple[str, int], ...]:
    """Return the folders in which packages are searched, and when their contents changed."""
    folders = [os.path.abspath(entry) for entry in sys.path if os.path.isdir(entry or ".")]
    return tuple((folder, os.stat(folder).st_mtime_ns) for folder in folders)


@lru_cache(maxsize=1)
def _entry_points(state: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of installed plug-ins; a search reads hundreds of files."""
    return tuple(entry_points(group=GROUP))


def _module_of(entry_point: EntryPoint) -> str:
    if entry_point.attr:
        raise PluginError(
            f"plug-in {entry_point.value!r} ({_source_of(entry_point)}): "
            "an entry point of a plug-in must name a package, not an object in it"
        )
    return entry_point.module


def _source_of(entry_point: EntryPoint) -> str:
    distribution = entry_point.dist
    package = "an unknown distribution" if distribution is None else distribution.name
    return f"entry point {entry_point.name!r} of {package}"


def _load(name: str, source: str) -> None:
    if name in PLUGINS:
        return
    try:
        import_module(name)
    except Exception as error:  # whatever the package raises, the message has to name the package
        reason = " ".join(str(error).split())
        raise PluginError(
            f"plug-in {name!r} ({source}) cannot be imported: {type(error).__name__}: {reason}"
        ) from error
    PLUGINS.add(name, Plugin(name))


_PACKAGE = Path(__file__).parent


def conf_dir() -> Path:
    """Return the folder with `config.yaml` and the groups of choices.

    A wheel contains it as `veca_marl/conf`; in a checkout it is `conf` beside the package.

    Raises:
        FileNotFoundError: If the installation is incomplete.
    """
    candidates = (_PACKAGE / "conf", _PACKAGE.parent / "conf")
    for folder in candidates:
        if (folder / "config.yaml").is_file():
            return folder
    raise FileNotFoundError(
        f"no configuration files (config.yaml) in {' or '.join(map(str, candidates))}"
    )

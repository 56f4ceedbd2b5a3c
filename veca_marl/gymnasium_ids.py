"""The tasks' ids in Gymnasium's registry: `veca_marl/<task>-v0`.

Gymnasium 1.0 and later look for no plug-ins: an id exists once it has been registered. This module
registers the ids when both packages have been imported, in whichever order. It imports neither
Gymnasium nor the simulator, so that `import veca_marl` stays fast.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from veca_marl.conf_dir import conf_dir
from veca_marl.plugins import GROUP, PluginError, load_plugins


def shipped_tasks() -> list[str]:
    """Return the names of the tasks that ship with the package, without importing them."""
    return sorted(path.stem for path in (conf_dir() / "task").glob("*.yaml"))


def register_task(name: str) -> None:
    """Register the id of one task if Gymnasium has been imported and does not know it yet.

    A task of several agents gets an id as well: making it raises an error that names
    `parallel_env`.
    """
    gymnasium = sys.modules.get("gymnasium")
    if gymnasium is not None:
        _register(gymnasium, [name])


def register_when_imported() -> None:
    """Register the ids of all tasks, now or as soon as Gymnasium is imported.

    Installed plug-ins are imported at that moment, because only then their tasks are known.
    """
    gymnasium = sys.modules.get("gymnasium")
    if gymnasium is None:
        sys.meta_path.insert(0, _GymnasiumFinder())
    else:
        _register_all(gymnasium)


def _register_all(gymnasium: Any) -> None:
    _register(gymnasium, shipped_tasks())
    if not entry_points(group=GROUP):
        return
    try:
        load_plugins()
    except PluginError as error:  # `import gymnasium` must not fail for it; `make` will
        warnings.warn(f"its tasks have no Gymnasium ids: {error}", stacklevel=2)
    import_module("veca_marl.api")  # registers the ids of all tasks that are known now


def _register(gymnasium: Any, tasks: Iterable[str]) -> None:
    for task in tasks:
        if f"veca_marl/{task}-v0" not in gymnasium.registry:
            gymnasium.register(
                id=f"veca_marl/{task}-v0",
                entry_point="veca_marl.api:gym_env",
                kwargs={"task": task},
            )


class _GymnasiumFinder(MetaPathFinder):
    """Finds Gymnasium where the other finders do, and lets `_RegisteringLoader` load it."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """See `MetaPathFinder`; every module but Gymnasium is left to the other finders.

        It stays in place when a spec was found: other packages look for Gymnasium's spec to learn
        whether it is installed, without importing it.
        """
        if name != "gymnasium" or name in sys.modules:
            return None
        others = [finder for finder in sys.meta_path if finder is not self]
        found = (finder.find_spec(name, path, target) for finder in others)
        spec = next((spec for spec in found if spec is not None), None)
        if spec is not None and spec.loader is not None:
            spec.loader = _RegisteringLoader(spec.loader)
        return spec


class _RegisteringLoader(Loader):
    """Loads Gymnasium with its own loader, then registers the ids.

    Args:
        loader: Gymnasium's own.
    """

    def __init__(self, loader: Loader) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """See `Loader`."""
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module and register the ids in its registry."""
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        self._loader.exec_module(module)
        _register_all(module)

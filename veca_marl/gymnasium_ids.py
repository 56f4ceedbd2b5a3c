"""The tasks' ids in Gymnasium's registry: `veca_marl/<task>-v0`.

Gymnasium 1.0 and later look for no plug-ins: an id exists once it has been registered, which
`import veca_marl` does. No environment is imported for it: an id holds the name of its factory.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from importlib.metadata import entry_points

import gymnasium

from veca_marl.plugins import GROUP, PluginError, conf_dir, load_plugins


def shipped_tasks() -> list[str]:
    """Return the names of the tasks that ship with the package, without importing them."""
    return sorted(path.stem for path in (conf_dir() / "task").glob("*.yaml"))


def register_task(name: str) -> None:
    """Register the id of one task if it is not known yet.

    A task of several agents gets an id as well: making it raises an error that names
    `parallel_env`.
    """
    if f"veca_marl/{name}-v0" not in gymnasium.registry:
        gymnasium.register(
            id=f"veca_marl/{name}-v0",
            entry_point="veca_marl.api:gym_env",
            kwargs={"task": name},
        )


def register_ids() -> None:
    """Register the ids of all tasks that ship with the package and of all installed plug-ins.

    Installed plug-ins are imported, because only then their tasks are known. One that cannot be
    imported is a warning here, so that the rest can be used, and an error in `veca_marl.make`.
    """
    for task in shipped_tasks():
        register_task(task)
    if not entry_points(group=GROUP):
        return
    try:
        load_plugins()
    except PluginError as error:
        warnings.warn(f"its tasks have no Gymnasium ids: {error}", stacklevel=2)
    import_module("veca_marl.api")  # registers the ids of all tasks that are known now

"""Human-like agents that see, hear and feel in one world, and learn.

`make` returns a task for TorchRL, `gym_env` for Gymnasium, `parallel_env` for PettingZoo, `connect`
one that another machine serves; `train` trains on a task; `save_episode` plays one into a page for
browsers; `check_task` checks one; `list_tasks` returns the names that they take; `zoo` has policies
that have learnt already. They are imported at their first use, so that the simulator
(`veca_marl.sim`) can be used without loading torch.

Importing this package registers the Gymnasium ids `veca_marl/<task>-v0`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from veca_marl.gymnasium_ids import register_ids
from veca_marl.version import __version__

if TYPE_CHECKING:
    from veca_marl.api import (
        check_task,
        connect,
        gym_env,
        list_tasks,
        make,
        parallel_env,
        save_episode,
        train,
    )

__all__ = [
    "__version__",
    "check_task",
    "connect",
    "gym_env",
    "list_tasks",
    "make",
    "parallel_env",
    "save_episode",
    "train",
]


def __getattr__(name: str) -> Any:
    """Import `veca_marl.api` at the first use of one of its functions (PEP 562)."""
    if name == "zoo":
        return import_module("veca_marl.zoo")
    if name in __all__:
        return getattr(import_module("veca_marl.api"), name)
    raise AttributeError(f"module 'veca_marl' has no attribute {name!r}; choices: {__all__}")


def __dir__() -> list[str]:
    """Return what can be used, for completion in notebooks."""
    return [*__all__]


register_ids()

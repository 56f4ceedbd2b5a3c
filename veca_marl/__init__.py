"""Human-like agents that see, hear and feel in one world, and learn.

`make` and `list_tasks` are the front door. They are imported when first used, so that the
simulator (`veca_marl.sim`) can be used without loading torch.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from veca_marl.api import list_tasks, make

__version__ = "0.1.0"
__all__ = ["__version__", "list_tasks", "make"]


if sys.modules.get("gymnasium"):  # whoever loaded it finds the ids there; nobody else pays for it
    import_module("veca_marl.envs.adapters.gymnasium_ids").register_ids()


def __getattr__(name: str) -> Any:
    """Import the front door at its first use (PEP 562)."""
    if name in ("make", "list_tasks"):
        return getattr(import_module("veca_marl.api"), name)
    raise AttributeError(f"module 'veca_marl' has no attribute {name!r}; there are {__all__}")

"""The Gymnasium ids of the tasks, made known without loading anything of them.

Gymnasium 1.0 and later look for no plugins: ids exist once somebody has registered them.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium

_PACKAGE = Path(__file__).parents[2]
_CONF = _PACKAGE / "conf" if (_PACKAGE / "conf").is_dir() else _PACKAGE.parent / "conf"
TASKS = _CONF / "task"


def register_ids() -> None:
    """Register `veca_marl/<task>-v0` for every task that has none yet.

    A task of several agents gets one as well: making it says what to use instead.
    """
    for path in sorted(TASKS.glob("*.yaml")):
        name = f"veca_marl/{path.stem}-v0"
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="veca_marl.envs.adapters.gymnasium:single_agent_env",
                kwargs={"task": path.stem},
            )

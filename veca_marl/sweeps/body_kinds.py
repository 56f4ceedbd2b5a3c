"""The registered names of the bodies of a configuration.

The stored configuration has the numbers of a body, not its class. Two kinds with the same numbers
are different bodies: their names are compared with the numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

_KEY = "registered_name"


def with_body_kinds(plain: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return a configuration in which each body has its registered name beside its numbers.

    Args:
        plain: The configuration as plain data.
        names: Registered name by the dotted path of a body, see `config.stored.body_names`.
    """
    marked = deepcopy(dict(plain))
    for path, name in names.items():
        node: Any = marked
        for part in path.split("."):
            node = node.get(part) if isinstance(node, dict) else None
        if isinstance(node, dict):
            node[_KEY] = name
    return marked


def former_kinds(names: Mapping[str, str]) -> dict[str, str]:
    """Return the names by dotted path, for runs that were stored without: see `differences`."""
    return {f"{path}.{_KEY}": name for path, name in names.items()}


def stored_kinds(provenance: Path) -> dict[str, str]:
    """Return the names in the ``provenance.json`` of a run; none if it has no such file or entry.

    A damaged file is reported by what needs the rest of it.
    """
    try:
        content = json.loads(provenance.read_text())
    except (OSError, ValueError):
        return {}
    names = content.get("bodies") if isinstance(content, dict) else None
    return dict(names) if isinstance(names, dict) else {}

"""Arrays that the modules of a policy exchange, under their keys in a TensorDict."""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Any

Key = str | tuple[str, ...]
Arrays = MutableMapping[Any, Any]  # `Key` to `Tensor`: a dict, or a TensorDict

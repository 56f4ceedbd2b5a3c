"""The error of environments that are used after `close`."""

from __future__ import annotations


def refuse_closed(is_closed: bool) -> None:
    """Refuse the use of an environment that is closed.

    Raises:
        RuntimeError: If it is.
    """
    if is_closed:
        raise RuntimeError("the environment is closed; make a new one")

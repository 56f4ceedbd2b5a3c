"""A check of the outer sizes of things that are made of boards."""

from __future__ import annotations

from collections.abc import Sequence


def check_size(name: str, size_m: Sequence[float], above_m: Sequence[float], needed: str) -> None:
    """Check that something is left between the boards of a thing.

    Args:
        name: Name of the prop.
        size_m: Its extents along x, y and z.
        above_m: What they must be above.
        needed: What needs so much, for the message.

    Raises:
        ValueError: If the sizes are not three, or one is too small.
    """
    fits = len(size_m) == len(above_m) and all(
        size > least for size, least in zip(size_m, above_m, strict=True)
    )
    if not fits:
        leasts = ", ".join(f"{least:g}" for least in above_m)
        raise ValueError(f"{name}: size_m={tuple(size_m)} must be above ({leasts}), for {needed}")

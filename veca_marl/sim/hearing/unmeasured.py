"""Directions below the lowest measured ring: which measured directions stand in for them."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.geometry import Floats


def stand_ins(directions: Floats, lowest_rad: float) -> tuple[Floats, Floats]:
    """Return two directions of the lowest ring for each direction below it, and their weights.

    Both have the lateral angle of the direction, on which interaural differences depend most
    (the cone of confusion); one lies in front and one behind. The weights change linearly with the
    angle around the ear axis, so that a response is continuous under the head and equals that of
    the ring on the ring.

    Args:
        directions: ``(..., 3)`` unit vectors with an elevation of at most `lowest_rad`.
        lowest_rad: Elevation of the ring, above -pi / 2.

    Returns:
        ``(..., 2, 3)`` unit vectors on the ring, the one in front first, and weights ``(..., 2)``.
    """
    lateral = directions[..., 1]
    down = np.sin(lowest_rad)
    forward = np.sqrt(np.maximum(np.cos(lowest_rad) ** 2 - lateral**2, 0.0))
    front = np.stack([forward, lateral, np.full_like(lateral, down)], axis=-1)
    behind = front * np.array([-1.0, 1.0, 1.0])
    # angles below the horizontal plane around the ear axis, counted from the front
    around = np.arctan2(-directions[..., 2], directions[..., 0])
    first = np.arctan2(-down, forward)
    to_behind = np.clip((around - first) / np.maximum(np.pi - 2.0 * first, 1e-9), 0.0, 1.0)
    return np.stack([front, behind], axis=-2), np.stack([1.0 - to_behind, to_behind], axis=-1)

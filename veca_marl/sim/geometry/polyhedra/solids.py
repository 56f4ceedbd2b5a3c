"""Polyhedra by name, with the origin in the middle of their bounding boxes."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry.polyhedra.polyhedron import Polyhedron, convex_hull

ARC_STEP_DEG = 12.0
"""Greatest angle of one straight edge of an arc; the edge is 0.6 % of the radius inside the arc."""


def pyramid(length_x: float, length_y: float, height: float) -> Polyhedron:
    """Return a pyramid with its base below and its tip above the middle of the base, metres."""
    x, y, z = length_x / 2.0, length_y / 2.0, height / 2.0
    base = [(i * x, j * y, -z) for i in (-1.0, 1.0) for j in (-1.0, 1.0)]
    return convex_hull([*base, (0.0, 0.0, z)])


def sector_of_disc(radius: float, height: float, angle_deg: float) -> Polyhedron:
    """Return a sector of a disc: a fraction ``angle / 360`` of a flat cylinder about z.

    The tip of the sector is at the origin, its middle on the x axis, its faces at half of the
    height above and below. Sectors of different angles around one axis fill a disc.

    Args:
        radius: Metres.
        height: Metres.
        angle_deg: In (0, 180]; a wider sector is not convex.

    Raises:
        ValueError: If the angle is out of its range.
    """
    if not 0.0 < angle_deg <= 180.0:
        raise ValueError(f"angle_deg={angle_deg}: a sector has more than 0 and at most 180 degrees")
    edges = math.ceil(angle_deg / ARC_STEP_DEG)
    around = np.deg2rad(angle_deg) * np.linspace(-0.5, 0.5, edges + 1)
    arc = radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    outline = np.vstack([np.zeros(2), arc])
    faces = [np.c_[outline, np.full(len(outline), side * height / 2.0)] for side in (-1.0, 1.0)]
    return convex_hull(np.vstack(faces))

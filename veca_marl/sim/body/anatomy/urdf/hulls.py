"""Convex hulls of capsules and boxes, as Bullet reads them from files.

Between two links of several shapes each, Bullet has one contact manifold per pair of shapes, and
solves these in an order that depends on earlier episodes. A link with one shape has one manifold
with each other link, and their order is that of the links.
"""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry import Floats, Pose, Primitive, Shape, rotation_with_z

# Bullet adds a margin to every hull (`gDefaultCollisionMargin` of its importer)
MARGIN_M = 0.001
_RINGS, _AROUND = 7, 20  # points of a half sphere: rings from pole to equator, and round each


def surface_points(part: Primitive, pose: Pose) -> Floats:
    """Return points ``(n, 3)`` whose hull is a capsule or a box on a frame at a pose.

    Those of a capsule lie so far out that its surface is inside the hull as often as outside.
    """
    inner = part.grown(-MARGIN_M)
    if part.shape is Shape.BOX:
        local = inner.corners()
    else:
        low, high = part.cap_centres()
        ball = inner.radius * _BULGE * _half_sphere(part.pose.rotation[:, 2])
        local = np.concatenate([high + ball, low - ball])
    points: Floats = pose.position + local @ pose.rotation.T
    return points


def as_obj(points: Floats) -> str:
    """Return points as Wavefront OBJ. Bullet computes the hull; the faces only list all points."""
    rows = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
    last = len(points)
    rows += [f"f {i} {min(i + 1, last)} {min(i + 2, last)}" for i in range(1, last + 1, 3)]
    return "\n".join(rows) + "\n"


def _half_sphere(axis: Floats) -> Floats:
    """Points on the unit half sphere about an axis, including its rim."""
    polar = np.linspace(0.0, math.pi / 2.0, _RINGS)
    around = np.linspace(0.0, 2.0 * math.pi, _AROUND, endpoint=False)
    polar, around = (grid.ravel() for grid in np.meshgrid(polar, around))
    x, y = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)
    points: Floats = np.stack([x, y, np.cos(polar)], axis=1) @ rotation_with_z(axis).T
    return np.unique(points.round(12), axis=0)


# the corners of a ring are as far outside the circle as the middles of its edges are inside
_BULGE = 2.0 / (1.0 + math.cos(math.pi / _AROUND))

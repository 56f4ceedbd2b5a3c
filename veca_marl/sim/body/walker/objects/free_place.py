"""How a held prop is moved out of walls and furniture, on the side of its holder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import pybullet

_TOUCHED_M = 1e-3  # a prop may overlap what it touches by so much
_ON_OBSTACLE, _NORMAL, _DISTANCE = 6, 7, 8  # entries of PyBullet's points of contact


def way_out(client: int, body_id: int, obstacles: Iterable[int], holder: Floats) -> Floats:
    """Return the displacement ``(3,)`` that moves a body out of obstacles, in metres.

    Each coordinate is that of the deepest overlap along it: several points of one face count once.
    One displacement ends the overlap with walls that are at right angles; others take several.

    Args:
        client: PyBullet's client id.
        body_id: PyBullet's id of the body, where it is now.
        obstacles: PyBullet's ids of the obstacles.
        holder: ``(3,)`` metres: a point on the side of all walls on which the body has to be.
    """
    out = np.zeros(3)
    for obstacle in obstacles:
        for point in pybullet.getClosestPoints(body_id, obstacle, 0.0, physicsClientId=client):
            depth_m = -float(point[_DISTANCE])
            if depth_m > _TOUCHED_M:
                way = depth_m * _towards_holder(point[_NORMAL], point[_ON_OBSTACLE], holder)
                out = np.where(np.abs(way) > np.abs(out), way, out)
    return out


def _towards_holder(
    normal: Sequence[float], on_obstacle: Sequence[float], holder: Floats
) -> Floats:
    """Return a unit vector out of an obstacle: its normal, or the way to the holder.

    The shortest way out of a thin wall can lead to its other side.
    """
    way = holder - np.asarray(on_obstacle)
    out = np.asarray(normal)
    return out if float(out @ way) > 0.0 else way / max(float(np.linalg.norm(way)), 1e-9)

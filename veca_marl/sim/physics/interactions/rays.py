"""Rays through the solid things of a world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet import pybullet

_MOST_HITS = 8  # a ray is followed through so many things
_LEAST_COSINE = 0.3  # of the angle between a ray and a normal: at flatter angles it is used instead


def free_path_m(
    client: int, start: Floats, end: Floats, clearance_m: float, ignored_id: int
) -> float:
    """Return how far a ball can move along a line before it touches something solid.

    The ray of its centre decides: at a plane that it meets at an angle the distance is exact, and
    things that the ray misses do not count.

    Args:
        client: PyBullet's client id.
        start: ``(3,)`` metres, outside of all things.
        end: ``(3,)`` metres.
        clearance_m: Radius of the ball.
        ignored_id: PyBullet's id of a body that does not count.

    Returns:
        Metres from `start`, at most the distance to `end`; negative if the ball has to move back.
    """
    length_m = float(np.linalg.norm(end - start))
    way = (end - start) / length_m
    longer = start + (length_m + clearance_m / _LEAST_COSINE) * way
    for hit in _hits(client, start, longer):
        if hit.body_id != ignored_id:
            cosine = max(abs(float(hit.normal @ way)), _LEAST_COSINE)
            return min(length_m, hit.distance_m - clearance_m / cosine)
    return length_m


def surface_m(client: int, body_id: int, start: Floats, end: Floats) -> float:
    """Return the distance from `start` to the surface of one body on the way to `end`.

    Args:
        client: PyBullet's client id.
        body_id: PyBullet's id of the body; other things do not count.
        start: ``(3,)`` metres, outside of it.
        end: ``(3,)`` metres.

    Returns:
        Metres; the distance to `end` if the ray misses the body.
    """
    its = (hit.distance_m for hit in _hits(client, start, end) if hit.body_id == body_id)
    return next(its, float(np.linalg.norm(end - start)))


class _Hit(NamedTuple):
    body_id: int
    distance_m: float
    normal: Floats


def _hits(client: int, start: Floats, end: Floats) -> Iterator[_Hit]:
    """Yield what a ray hits, the nearest first."""
    length_m = float(np.linalg.norm(end - start))
    for number in range(_MOST_HITS):
        body_id, _, share, _, normal = pybullet.rayTestBatch(
            [start.tolist()], [end.tolist()], reportHitNumber=number, physicsClientId=client
        )[0]
        if body_id == -1:
            return
        yield _Hit(body_id, float(share) * length_m, np.array(normal))

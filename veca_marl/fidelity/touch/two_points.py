"""Two-point resolution: the distance at which two points that press are told from one.

Two balls of 3 mm press into the skin. They are resolved if the readings have a maximum at each ball
and fall below half of the smaller maximum between them, in the middle third of the line, where at
least one taxel must lie. The threshold of a bone is the smallest distance at which three quarters
of random pairs are resolved.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.fidelity.touch.bare_body import BareBody
from veca_marl.fidelity.touch.pokes import NOTICED
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import Bools, Floats, Shape
from veca_marl.sim.touch import TouchCfg

RADIUS_M = 0.0015
DISTANCES_M = (0.003, 0.004, 0.006, 0.009, 0.013, 0.018, 0.025, 0.035, 0.045, 0.06, 0.08)
_DEPTH = 0.5
_RESOLVED = 0.75
_VALLEY = 0.5


def threshold_m(bone: str, count: int, rng: np.random.Generator) -> float:
    """Return the two-point threshold of a bone, metres; infinite if none of `DISTANCES_M`.

    Args:
        bone: Its name.
        count: Number of pairs for each distance.
        rng: Chooses the pairs.
    """
    body = BareBody(TouchCfg(), Shape.SPHERE, (RADIUS_M,), count=2)
    index = load_skeleton().bone(bone)
    for distance_m in DISTANCES_M:
        if resolved_share(body, index, distance_m, count, rng) >= _RESOLVED:
            return distance_m
    return float("inf")


def resolved_share(
    body: BareBody, bone: int, distance_m: float, count: int, rng: np.random.Generator
) -> float:
    """Return the share of random pairs of points at a distance that are resolved."""
    pairs = [_random_pair(body, bone, distance_m, rng) for _ in range(count)]
    return float(np.mean([_resolved(body, bone, pair) for pair in pairs]))


def _random_pair(
    body: BareBody, bone: int, distance_m: float, rng: np.random.Generator
) -> list[tuple[Floats, Floats]]:
    """Return two points of the skin of a bone with their normals."""
    place, normal = body.random_point(bone, rng)
    along = np.cross(normal, rng.normal(size=3))
    along *= 0.5 * distance_m / np.linalg.norm(along)
    return [body.onto_skin(bone, place + way * along) for way in (-1.0, 1.0)]


def _resolved(body: BareBody, bone: int, pair: Sequence[tuple[Floats, Floats]]) -> bool:
    """Return whether the readings of two points have two maxima and a gap between them."""
    depth_m = _DEPTH * load_skeleton().bones[bone].skin_thickness_m
    readings = body.read(*[(at + (RADIUS_M - depth_m) * out, out) for at, out in pair]).ravel()
    (first, _), (second, _) = pair
    line = second - first
    along = ((body.taxels().reshape(-1, 3) - first) @ line) / (line @ line)
    between = readings[(along > 1 / 3) & (along < 2 / 3) & _near(body, first, second)]
    peaks = min(readings[along < 1 / 3].max(), readings[along > 2 / 3].max())
    return bool(peaks > NOTICED and len(between) > 0 and between.max() < _VALLEY * peaks)


def _near(body: BareBody, first: Floats, second: Floats) -> Bools:
    """Return which taxels lie within the distance of two points from their middle."""
    away = np.linalg.norm(body.taxels().reshape(-1, 3) - (first + second) / 2, axis=1)
    near: Bools = away < np.linalg.norm(second - first)
    return near

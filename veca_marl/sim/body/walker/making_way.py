"""Where a capsule goes that something moves against fixed things: these win.

A heavy thing can displace a walker by any distance, a wall behind it only by as much as it is in
the wall. If both counted alike, the walker would be moved into the wall, and out of it on its other
side. Here it first makes way for what moves, by less than its radius from where it was, so that its
axis stays on the same side of everything fixed, and is then moved out of fixed things only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

Overlap = tuple[Sequence[float], float]
"""Direction ``(3,)`` towards the capsule, and metres."""

Place = tuple[float, float]
"""``(x, y)`` on the floor plan, metres."""

FIRM_M = 1e-3
"""A fixed thing may be overlapped by so much, which is more than rounding."""

_DEPTH_M = 1e-6  # less is rounding
_ROUNDS = 6  # acute corners take several
_MADE_WAY = 0.9  # of the radius, at most


class MovedCapsule(Protocol):
    """What `make_way` moves; at the end it is where the walker is."""

    @property
    def radius_m(self) -> float:
        """Radius about its axis."""
        ...

    def move_to(self, x: float, y: float) -> None:
        """Move it to a place."""
        ...

    def firm_overlaps(self) -> Iterator[Overlap]:
        """Yield how deep it is in what is fixed, or cannot give way."""
        ...

    def pushes(self) -> Iterator[Overlap]:
        """Yield by how much what moves displaces it."""
        ...


def may_reach(capsule: MovedCapsule, place: Place, last: Place) -> bool:
    """Return whether the axis is still on the same side of everything fixed, however thin.

    Args:
        capsule: The capsule.
        place: Where it would be.
        last: Where it was at the end of the last physics step.
    """
    return math.dist(place, last) <= capsule.radius_m


def make_way(capsule: MovedCapsule, asked: Place, found: Place, last: Place) -> Place:
    """Move a capsule to where nothing has moved it into fixed things; return the place.

    A walker that is squeezed may walk where it is squeezed less, and otherwise does not walk.

    Args:
        capsule: The capsule.
        asked: Its place before contacts were resolved.
        found: The place at which contacts with all that moves and is fixed alike have ended.
        last: Its place at the end of the last physics step.
    """
    last_m = _firm_m(capsule, last)
    if last_m > capsule.radius_m / 2.0:  # something fixed was placed here
        capsule.move_to(*found)
        return found
    pushed_m = max(deepest_m(capsule.pushes()), FIRM_M)
    firm_m = max(last_m, FIRM_M)
    place, is_possible = found, False
    for start in (None, asked, last):
        place = found if start is None else _made_way(capsule, start, last)
        is_possible = may_reach(capsule, place, last) and _firm_m(capsule, place) <= firm_m
        if is_possible and deepest_m(capsule.pushes()) <= pushed_m:
            return place
    if not is_possible:
        place = last
        capsule.move_to(*last)
    return place


def _made_way(capsule: MovedCapsule, start: Place, last: Place) -> Place:
    """Move a capsule out of what pushes it, then out of fixed things; return the place."""
    capsule.move_to(*start)
    out_x, out_y = depenetration(capsule.pushes())
    x, y = _towards(last, (start[0] + out_x, start[1] + out_y), _MADE_WAY * capsule.radius_m)
    for _ in range(_ROUNDS):
        capsule.move_to(x, y)
        out_x, out_y = depenetration(capsule.firm_overlaps())
        if out_x == 0.0 and out_y == 0.0:
            break
        x, y = x + out_x, y + out_y
    return x, y


def _firm_m(capsule: MovedCapsule, place: Place) -> float:
    """Move a capsule to a place; return how deep it is in something fixed there, metres."""
    capsule.move_to(*place)
    return deepest_m(capsule.firm_overlaps())


def _towards(start: Place, end: Place, most_m: float) -> Place:
    """Return the point on the way from one point to another, at most some metres from the start."""
    length_m = math.dist(start, end)
    share = min(1.0, most_m / length_m) if length_m else 0.0
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def depenetration(overlaps: Iterable[Overlap]) -> tuple[float, float]:
    """Return the horizontal displacement that ends all overlaps, metres."""
    out_x = out_y = 0.0
    for normal, depth in overlaps:
        length = math.hypot(normal[0], normal[1])
        if depth > _DEPTH_M and length > 0.1:
            # several points of one face give the same direction: the deepest counts
            away_x, away_y = normal[0] / length * depth, normal[1] / length * depth
            out_x = _larger(out_x, away_x)
            out_y = _larger(out_y, away_y)
    return out_x, out_y


def deepest_m(overlaps: Iterable[Overlap]) -> float:
    """Return the depth of the deepest overlap that a horizontal displacement can end, metres."""
    level = (depth for normal, depth in overlaps if math.hypot(normal[0], normal[1]) > 0.1)
    return max(level, default=0.0)


def _larger(a: float, b: float) -> float:
    """Return the number with the larger absolute value."""
    return a if abs(a) >= abs(b) else b

"""Whether a prop fits into a container, and where above it is free to fall in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.props.prop import Prop
from veca_marl.sim.physics.props.prop_cfg import PropShape

_GAP_M = 0.01  # between the lowest point of the prop and what it falls on, or the rim
_RIM_M = 0.02  # thickness of the walls of a container
# corners, middle and edges of a container, as shares of the way from the middle to the rim
_PLACES = np.array(
    [(1, 1), (-1, -1), (1, -1), (-1, 1), (0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], np.float64
)


def fits(prop: Prop, container: Prop) -> bool:
    """Return whether a prop is narrower than the inside of a container."""
    low, high = container.box
    wall_m = _RIM_M if container.cfg.shape is PropShape.compound else 0.0  # plates have none
    return 2.0 * (prop.radius_m + wall_m) <= float(np.min((high - low)[:2]))


def is_covered(prop: Prop, container: Prop, others: Iterable[Prop]) -> bool:
    """Return whether a lid, or another leaf, is above each place in a container for a prop.

    Args:
        prop: The prop.
        container: The container, upright.
        others: All props of the world.
    """
    leaves = [_in_frame(p, container) for p in others if p.joint is not None and p is not container]
    half = np.full(2, prop.radius_m)
    piles = [_pile_m(place - half, place + half, leaves) for place in _places(container, half)]
    return min(piles) > -np.inf


def place_above(prop: Prop, container: Prop, others: Iterable[Prop]) -> Floats:
    """Return where a prop is free above a container and what lies in it, ``(3,)`` metres.

    Of the corners, the middle and the edges of the container it is the place above the lowest pile;
    of equal ones the first. Piles are measured by the bounding boxes of movable props.

    Args:
        prop: Upright, with the yaw of the container, elsewhere.
        container: The container, upright.
        others: All props of the world.
    """
    (_, high), (own_low, own_high) = container.box, prop.box
    half = (own_high - own_low)[:2] / 2.0
    places = _places(container, half)
    piles = [_in_frame(p, container) for p in others if p not in (prop, container) and not p.fixed]
    heights = [_pile_m(place - half, place + half, piles) for place in places]
    best = int(np.argmin(heights))
    bottom_m = max(heights[best], float(high[2])) + _GAP_M
    middle = (own_low + own_high)[:2] / 2.0
    local = np.array([*(places[best] - middle), bottom_m - own_low[2]])
    world: Floats = container.position + container.rotation @ local
    return world


def _places(container: Prop, half: Floats) -> Floats:
    """Return places ``(9, 2)`` in a container's frame for a prop of half widths ``(2,)``."""
    low, high = container.box
    reach = np.maximum((high - low)[:2] / 2.0 - half - _RIM_M, 0.0)
    places: Floats = ((low + high) / 2.0)[:2] + _PLACES * reach
    return places


def _in_frame(prop: Prop, container: Prop) -> tuple[Floats, Floats]:
    """Return the corners of a box about the bounding box of a prop in the container's frame."""
    low, high = prop.bounds()
    middle = container.rotation.T @ ((low + high) / 2.0 - container.position)
    half = np.abs(container.rotation.T) @ ((high - low) / 2.0)
    return middle - half, middle + half


def _pile_m(low: Floats, high: Floats, piles: Sequence[tuple[Floats, Floats]]) -> float:
    """Return the height of the highest box that overlaps a rectangle; minus infinity if none."""
    overlapping = [
        float(top[2])
        for bottom, top in piles
        if (bottom[:2] < high).all() and (top[:2] > low).all()
    ]
    return max(overlapping, default=-np.inf)

"""Putting the held prop into a container."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop

_GAP_M = 0.01  # between the lowest point of the prop and what it falls on, or the rim
_PLACES = 8  # on the ring inside the rim


@register_interaction
class PutInto(Interaction):
    """Release the held prop above the emptiest place of a container, into which it falls.

    The container declares the verb. The prop must be held, be narrower than the container, and be
    accepted by it (`Prop.accepts`).
    """

    name: ClassVar[str] = "put_into"

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the container nearest to the centre of the view, whatever else is nearer."""
        return next((p for p in body.interactable_objects() if self.declared_by(p)), None)

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the held prop fits into the container and is accepted by it."""
        held = body.held
        return held is not None and fits(held, prop) and prop.accepts(held)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Open the hand and place the prop above the container, at rest and upright."""
        held = body.held
        if held is not None:
            body.release()
            held.place(place_above(held, prop, body.world.props.values()), held.yaw_rad)


def fits(prop: Prop, container: Prop) -> bool:
    """Return whether a prop is narrower than the bounding box of a container."""
    low, high = container.bounds()
    return 2.0 * prop.radius_m <= float(np.min((high - low)[:2]))


def place_above(prop: Prop, container: Prop, others: Iterable[Prop]) -> Floats:
    """Return where a prop is free above a container and what lies in it, ``(3,)`` metres.

    Of the middle and the places on a ring inside the rim, it is the one above the lowest pile.
    Piles are measured by the bounding boxes of movable props.

    Args:
        prop: Upright, elsewhere.
        container: The container.
        others: All props of the world.
    """
    low, high = container.bounds()
    middle, half_m = (low + high) / 2.0, float(np.min((high - low)[:2])) / 2.0
    ring_m = max(half_m - prop.radius_m, 0.0)
    piles = [p.bounds() for p in others if p not in (prop, container) and not p.fixed]
    places = [middle[:2], *(middle[:2] + ring_m * way for way in _ring())]
    heights = [_pile_m(place, prop.radius_m, piles) for place in places]
    best = int(np.argmin(heights))  # the first of equals: the middle
    below_m = float(prop.position[2]) - prop.lowest_m
    bottom_m = max(heights[best], float(high[2])) + _GAP_M
    return np.array([*places[best], bottom_m + below_m])


def _ring() -> Floats:
    """Return unit vectors ``(8, 2)`` in all directions."""
    angles = np.arange(_PLACES) * 2.0 * np.pi / _PLACES
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _pile_m(place: Floats, radius_m: float, piles: Sequence[tuple[Floats, Floats]]) -> float:
    """Return the height of the highest box that overlaps the square round a place; 0 if none."""
    overlapping = [
        float(high[2])
        for low, high in piles
        if (low[:2] < place + radius_m).all() and (high[:2] > place - radius_m).all()
    ]
    return max(overlapping, default=0.0)

"""Putting the held prop into a container."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.interactions.rays import first_hit_m
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop

_GAP_M = 0.01  # between the lowest point of the prop and what it falls on, or the rim
_PILE_M = 1.0  # height of a pile in the container above its rim that is taken into account


@register_interaction
class PutInto(Interaction):
    """Release the held prop above the middle of a container, into which it falls.

    The container declares the verb. The prop must be held, be narrower than the container, and be
    accepted by it (`Prop.accepts`).
    """

    name: ClassVar[str] = "put_into"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the held prop fits into the container and is accepted by it."""
        held = body.held
        return held is not None and fits(held, prop) and prop.accepts(held)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Open the hand and place the prop above the container, at rest and upright."""
        held = body.held
        if held is not None:
            body.release()
            held.place(place_above(held, prop, body.world.client), held.yaw_rad)


def fits(prop: Prop, container: Prop) -> bool:
    """Return whether a prop is narrower than the bounding box of a container."""
    low, high = container.bounds()
    return 2.0 * prop.radius_m <= float(np.min((high - low)[:2]))


def place_above(prop: Prop, container: Prop, client: int) -> Floats:
    """Return where a prop is free above a container and what lies in it, ``(3,)`` metres.

    Args:
        prop: Upright, elsewhere.
        container: The container.
        client: PyBullet's id of their world.
    """
    low, high = container.bounds()
    x, y, rim_m = (low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, high[2]
    top = np.array([x, y, rim_m + _PILE_M])
    pile_m = top[2] - first_hit_m(client, top, np.array([x, y, low[2]]))
    below_m = float(prop.position[2]) - prop.lowest_m
    return np.array([x, y, max(rim_m, pile_m) + _GAP_M + below_m])

"""How deep two joint-level bodies may be in each other.

Joint limits that are set back at a contact press bones of one body into the other, as they press
them into the floor, see `bone_ends`; Bullet's contacts push them out over several physics steps.
Both bodies are therefore moved apart by what their deepest contacts have in excess of `DEEPEST_M`,
each by the other's share of the mass, so that their common centre of mass stays where it is. Only
along the vertical the upper body moves alone, because the lower one would be pressed into the
floor. Momentum and joints stay.
"""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.humanoid.bone_ends import DEEPEST_M
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet_client import BulletClient


def separating_shifts(
    client: BulletClient, body: int, other: int, share: float
) -> tuple[Floats, Floats] | None:
    """Return what two bodies are to be moved by, or None if they are not too deep in each other.

    Args:
        client: The PyBullet client.
        body: Bullet's id of the one body.
        other: That of the other one.
        share: Mass of the other body as a fraction of that of both.

    Returns:
        ``(3,)`` metres each, of the one and of the other.
    """
    relative = _excess(client, body, other)
    if relative is None:
        return None
    up, down = max(relative[2], 0.0), max(-relative[2], 0.0)
    shift, opposite = share * relative, (share - 1.0) * relative
    shift[2], opposite[2] = up, down
    return shift, opposite


def _excess(client: BulletClient, body: int, other: int) -> Floats | None:
    """Return by what a body has to move relative to another one, ``(3,)`` metres.

    Links that did not touch in the last physics step are left out: to look at all pairs takes
    milliseconds.
    """
    touching = {
        (contact.link_a, contact.link_b)
        for contact in client.getContactPoints(bodyA=body, bodyB=other)
        if contact.distance_m < 0.0
    }
    deep = sorted(
        (point.distance_m, point.normal_on_b)
        for a, b in sorted(touching)
        for point in client.getClosestPoints(body, other, -DEEPEST_M, a, b)
    )
    relative = np.zeros(3)
    for distance_m, normal in deep:
        direction = np.array(normal)
        relative += max(-DEEPEST_M - distance_m - float(relative @ direction), 0.0) * direction
    return relative if deep else None

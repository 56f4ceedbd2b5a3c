"""Whether nothing solid is between a walker and a prop."""

from __future__ import annotations

from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import pybullet

# the ray begins so far outside of the walker's own capsule, which it must not hit
_CLEARANCE_M = 1e-4


def is_first_hit(
    client: int, body_id: int, start: Floats, end: Floats, skip_m: float, height_m: float
) -> bool:
    """Return whether a horizontal ray meets a body before any other solid thing.

    Intangible props are not solid. Bullet's ray test considers the poses that were set last.

    Args:
        client: The PyBullet client.
        body_id: PyBullet's id of the body that should be hit first.
        start: ``(3,)`` metres; only the horizontal part counts.
        end: ``(3,)`` metres, likewise.
        skip_m: The ray begins at this distance from `start`.
        height_m: Height of the ray.

    Returns:
        True also if the ray hits nothing, as with the open centre of a goal, and if `end` is
        nearer than `skip_m`.
    """
    length_m, skip_m = horizontal_distance(start, end), skip_m + _CLEARANCE_M
    if length_m <= skip_m:
        return True
    share = skip_m / length_m
    x, y = (float(start[i] + share * (end[i] - start[i])) for i in range(2))
    goal = (float(end[0]), float(end[1]), height_m)
    hit_id = pybullet.rayTest((x, y, height_m), goal, physicsClientId=client)[0][0]
    return hit_id in (-1, body_id)

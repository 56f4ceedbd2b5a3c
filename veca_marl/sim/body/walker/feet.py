"""The feet of a walker: what they stand on, step on and kick."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.sense_organs import distance_m
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, PropShape
from veca_marl.sim.physics.bullet import surface_m
from veca_marl.sim.physics.bullet_client import BulletClient

# the ray begins so far outside of the walker's own capsule, which it must not hit
_CLEARANCE_M = 1e-4


def is_first_hit(
    client: BulletClient, body_id: int, start: Floats, end: Floats, skip_m: float, height_m: float
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
    (hit,) = client.rayTest((x, y, height_m), goal)
    return hit.body_id in (-1, body_id)


_ABOVE_M = 0.1  # a ray begins so far above a prop


class Footing:
    """The prop under a walker, and the height of its surface.

    Args:
        client: The PyBullet client.

    Attributes:
        prop: What the walker has stepped on; None on the floor.
        low: Things on the floor so low that it walks over them.
        height_m: Height of the surface under the walker's axis; 0 on the floor.
    """

    def __init__(self, client: BulletClient) -> None:
        self._client = client
        self.leave()

    def leave(self) -> None:
        """Stand on the floor."""
        self.prop: Prop | None = None
        self.low: list[Prop] = []
        self.height_m = 0.0

    def step_on(self, prop: Prop) -> None:
        """Stand on a prop, from the next call of `follow`."""
        self.prop = prop

    def follow(self, x: float, y: float) -> None:
        """Compute the height at a place; beside the prop the walker stands on the floor again."""
        if self.prop is None:
            heights = (surface_height_m(self._client, low, x, y) for low in self.low)
            self.height_m = max((height for height in heights if height), default=0.0)
            return
        height_m = surface_height_m(self._client, self.prop, x, y)
        if height_m is None:
            self.leave()
        else:
            self.height_m = height_m


def surface_height_m(client: BulletClient, prop: Prop, x: float, y: float) -> float | None:
    """Return the height of the upper surface of a prop at a place; None beside it."""
    low, high = prop.bounds()
    top, bottom = np.array([x, y, high[2] + _ABOVE_M]), np.array([x, y, low[2] - _ABOVE_M])
    height_m = float(top[2]) - surface_m(client, prop.body_id, top, bottom)
    return height_m if height_m > bottom[2] + 1e-6 else None


_ROUND = 8  # places round a walker at which surfaces are measured
_AHEAD_M = 0.06  # beyond the capsule: more than the way of a step of 40 ms at 1 m/s
_SLOPING = (PropShape.compound, PropShape.convex)


def is_walked_over(
    client: BulletClient, prop: Prop, place: Floats, base_m: float, cfg: WalkerCfg, yaw_rad: float
) -> bool:
    """Return whether a thing is low, or a slope so flat, that a walker walks over it.

    Args:
        client: The PyBullet client.
        prop: A fixed or heavy one.
        place: ``(2,)`` metres, of the walker.
        base_m: Height on which it walks.
        cfg: Its parameters.
        yaw_rad: Its heading.
    """
    highest_m = base_m + cfg.stride_height_m
    if float(prop.bounds()[1][2]) <= highest_m:
        return True
    if prop.cfg.shape not in _SLOPING:
        return False
    reach_m = cfg.radius_m + _AHEAD_M
    angles = yaw_rad + np.arange(_ROUND) * 2.0 * math.pi / _ROUND
    places = [place, *(place + reach_m * np.stack([np.cos(angles), np.sin(angles)], 1))]
    found = [surface_height_m(client, prop, float(x), float(y)) for x, y in places]
    heights = [height_m for height_m in found if height_m is not None]
    return bool(heights) and max(heights) <= highest_m


def foot_steps_on(client: BulletClient, cfg: WalkerCfg, ground: Floats, prop: Prop) -> bool:
    """Return whether a tangible prop is low and near enough, and nothing solid is before it.

    Args:
        client: The PyBullet client.
        cfg: Parameters of the walker.
        ground: ``(2,)`` metres: its place on the floor.
        prop: The prop.
    """
    height_m = surface_height_m(client, prop, *middle(prop))
    if height_m is None or height_m > cfg.step_height_m or not prop.cfg.tangible:
        return False
    foot = np.array([ground[0], ground[1], prop.lowest_m])
    if distance_m(prop, foot) - cfg.radius_m > cfg.step_reach_m:
        return False
    end, height_m = np.array([*middle(prop), height_m]), (prop.lowest_m + height_m) / 2.0
    return is_first_hit(client, prop.body_id, foot, end, cfg.radius_m, height_m)


def middle(prop: Prop) -> tuple[float, float]:
    """Return the middle of the bounding box of a prop on the floor plan, metres."""
    low, high = prop.bounds()
    return float(low[0] + high[0]) / 2.0, float(low[1] + high[1]) / 2.0


_BEYOND_M = 0.1  # more than the margins of Bullet's shapes
_LIFT = 0.2  # vertical velocity of a kicked prop as a fraction of the horizontal one


def foot_reaches(
    client: BulletClient, cfg: WalkerCfg, capsule_id: int, here: Floats, yaw_rad: float, prop: Prop
) -> bool:
    """Return whether a prop is near enough, low enough and ahead, and nothing solid is before it.

    Args:
        client: The PyBullet client.
        cfg: Parameters of the walker.
        capsule_id: PyBullet's id of its capsule.
        here: ``(3,)`` metres: position of the walker.
        yaw_rad: Its heading.
        prop: The prop.
    """
    at = prop.position
    away_m = math.hypot(at[0] - here[0], at[1] - here[1])
    if away_m > cfg.radius_m + cfg.kick_reach_m + prop.extent_m + _BEYOND_M:
        return False
    if not client.getClosestPoints(capsule_id, prop.body_id, cfg.kick_reach_m):
        return False
    if prop.lowest_m > cfg.kick_height_m:
        return False
    there = prop.mass_centre
    ahead = math.atan2(there[1] - here[1], there[0] - here[0]) - yaw_rad
    aside = abs((ahead + math.pi) % (2.0 * math.pi) - math.pi)
    if aside > math.radians(cfg.kick_angle_deg):
        return False
    height_m = min(float(there[2]), cfg.kick_height_m)
    return is_first_hit(client, prop.body_id, here, there, cfg.radius_m, height_m)


def kicked_velocity(cfg: WalkerCfg, here: Floats, prop: Prop) -> Floats:
    """Return the velocity ``(3,)`` m/s of a prop after a kick away from a walker.

    The kick adds an impulse of at most `kick_impulse_ns`, away from the walker and upwards, until
    the prop moves away at `kick_speed_mps`; one that is faster keeps its velocity. The impulse acts
    on its centre of mass, so that its angular velocity does not change.

    Args:
        cfg: Parameters of the walker.
        here: ``(3,)`` metres: position of the walker.
        prop: The prop.
    """
    away = prop.mass_centre - here
    away[2] = 0.0
    away /= max(float(np.linalg.norm(away)), 1e-9)
    before = prop.velocity
    most_mps = cfg.kick_impulse_ns / prop.cfg.mass_kg / math.hypot(1.0, _LIFT)
    added_mps = min(max(cfg.kick_speed_mps - float(before @ away), 0.0), most_mps)
    velocity: Floats = before + added_mps * (away + np.array([0.0, 0.0, _LIFT]))
    return velocity

"""Kicks of a walker: which props the foot reaches, and the velocity that a kick gives them."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, pybullet

# the ray begins so far outside of the walker's own capsule, which it must not hit
_CLEARANCE_M = 1e-4
_LIFT = 0.2  # vertical velocity of a kicked prop as a fraction of the horizontal one


def foot_reaches(
    client: int, cfg: WalkerCfg, capsule_id: int, here: Floats, yaw_rad: float, prop: Prop
) -> bool:
    """Return whether a prop is near enough, low enough and ahead, and nothing solid is before it.

    Args:
        client: PyBullet's client id.
        cfg: Parameters of the walker.
        capsule_id: PyBullet's id of its capsule.
        here: ``(3,)`` metres: position of the walker.
        yaw_rad: Its heading.
        prop: The prop.
    """
    if prop.lowest_m > cfg.kick_height_m or not pybullet.getClosestPoints(
        capsule_id, prop.body_id, cfg.kick_reach_m, physicsClientId=client
    ):
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

    Args:
        cfg: Parameters of the walker.
        here: ``(3,)`` metres: position of the walker.
        prop: The prop.
    """
    away = prop.mass_centre - here
    away[2] = 0.0
    away /= max(float(np.linalg.norm(away)), 1e-9)
    speed = min(cfg.kick_speed_mps, cfg.kick_impulse_ns / prop.cfg.mass_kg)
    velocity: Floats = speed * away + np.array([0.0, 0.0, _LIFT * speed])
    return velocity


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

"""Kicks of a walker: which props the foot reaches, and the velocity that a kick gives them."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.walker.collisions.free_line import is_first_hit
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, pybullet

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

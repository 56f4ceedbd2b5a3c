"""The rigid body of a prop in Bullet: its shape, mass, inertia, friction and restitution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from veca_marl.sim.geometry import (
    Floats,
    Inertia,
    Pose,
    Primitive,
    joined_inertia,
    primitive_inertia,
)
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.collision_shapes import create_collision_shape
from veca_marl.sim.physics.props.prop_cfg import PropCfg, PropShape

_STEP_S = 0.008  # physics step at which `contact_share` is used as it is
_EXACT_IN_BULLET = (PropShape.sphere, PropShape.box, PropShape.cylinder)


def create_prop_body(cfg: PropCfg, client: int, geoms: Sequence[Primitive]) -> tuple[int, Floats]:
    """Create the rigid body of a prop, with its frame at the origin.

    Bullet uses the inertia of the bounding box for capsules and for several primitives at once, and
    takes the origin of the frame as the centre of mass. Both are set here.

    Args:
        cfg: The prop.
        client: PyBullet's client id.
        geoms: Its primitives, in its frame.

    Returns:
        PyBullet's id, and the centre of mass in the frame of the prop, ``(3,)`` metres. Poses of
        the body in Bullet are those of its centre of mass. A fixed prop has it at the origin.
    """
    inertia = None if cfg.mass_kg == 0.0 else prop_inertia(geoms, cfg.mass_kg)
    centre: Floats = np.zeros(3) if inertia is None else inertia.centre
    if centre.any():
        geoms = [replace(geom, offset=np.asarray(geom.offset) - centre) for geom in geoms]
    shape = create_collision_shape(client, geoms)
    body_id: int = pybullet.createMultiBody(
        cfg.mass_kg, shape, basePosition=centre.tolist(), physicsClientId=client
    )
    pybullet.changeDynamics(body_id, -1, **_dynamics(cfg, inertia), physicsClientId=client)
    if not cfg.tangible:
        pybullet.setCollisionFilterGroupMask(body_id, -1, 0, 0, physicsClientId=client)
    return body_id, centre


def limit_detection(body_id: int, cfg: PropCfg, client: int, clock: ClockCfg) -> None:
    """Limit how far ahead a movable prop with restitution has contacts at short physics steps.

    Bullet subtracts the distance to a contact over the time step from the speed of rebound: at a
    constant distance a ball would rebound less, the shorter the step. Steps of 8 ms and more need
    no limit.
    """
    shortening = clock.substep_s / _STEP_S
    if cfg.mass_kg > 0.0 and cfg.restitution > 0.0 and shortening < 1.0:
        low, high = pybullet.getAABB(body_id, physicsClientId=client)
        size = float(np.linalg.norm(np.subtract(high, low))) / 2.0
        pybullet.changeDynamics(
            body_id,
            -1,
            contactProcessingThreshold=clock.contact_share * shortening * size,
            physicsClientId=client,
        )


def prop_inertia(geoms: Sequence[Primitive], mass_kg: float) -> Inertia:
    """Return the inertia of primitives of one density, in the frame that they are on.

    A volume in which primitives overlap counts for each of them.
    """
    volumes = np.array([geom.volume for geom in geoms])
    masses = mass_kg * volumes / volumes.sum()
    here = Pose(np.zeros(3), np.eye(3))
    parts = [
        (here, primitive_inertia(geom, float(mass)))
        for geom, mass in zip(geoms, masses, strict=True)
    ]
    return joined_inertia(parts)


def _dynamics(cfg: PropCfg, inertia: Inertia | None) -> dict[str, Any]:
    """Return the arguments of PyBullet's `changeDynamics`."""
    arguments: dict[str, Any] = {
        "lateralFriction": cfg.friction,
        "rollingFriction": cfg.rolling_friction,
        "spinningFriction": cfg.rolling_friction,
        "restitution": cfg.restitution,
        "linearDamping": 0.0,
        "angularDamping": 0.0,  # only friction slows objects down
    }
    if inertia is not None and cfg.shape not in _EXACT_IN_BULLET:
        # all shapes of props are symmetric about two planes: their axes are principal axes
        arguments["localInertiaDiagonal"] = np.diag(inertia.matrix).tolist()
    return arguments

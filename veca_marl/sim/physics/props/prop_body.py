"""The body of a prop in Bullet, with or without a joint, and its pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from veca_marl.sim.geometry import Geom, Pose
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.props.joint import LINK, Joint
from veca_marl.sim.physics.props.prop_cfg import PropCfg
from veca_marl.sim.physics.props.rigid_body import create_attached_body, create_prop_body


def create_body(
    cfg: PropCfg, client: int, geoms: Sequence[Geom]
) -> tuple[int, int, Joint | None, Pose]:
    """Create the body of a prop; return its id and link, its joint and its inertial frame."""
    if cfg.joint is None:
        body_id, frame = create_prop_body(cfg, client, geoms)
        return body_id, -1, None, frame
    body_id, frame = create_attached_body(cfg, cfg.joint, client, geoms)
    return body_id, LINK, Joint(cfg.joint, body_id, client), frame


def pose_reader(body_id: int, link: int, client: int) -> Callable[[], tuple[Any, ...]]:
    """Return a function that reads position and quaternion of the inertial frame first."""
    if link == -1:
        return partial(pybullet.getBasePositionAndOrientation, body_id, physicsClientId=client)
    return partial(
        pybullet.getLinkState,
        body_id,
        link,
        computeForwardKinematics=1,
        physicsClientId=client,
    )

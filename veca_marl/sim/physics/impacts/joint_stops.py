"""The impulse with which a door, drawer or lid meets the end of its range."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.props import JointKind, PropCfg
from veca_marl.sim.physics.props.geoms import bounding_box, prop_geoms
from veca_marl.sim.physics.props.rigid_body import prop_inertia


@dataclass(frozen=True)
class JointStop:
    """What stops the motion of a joint, at the point of the prop that is farthest from a hinge.

    Attributes:
        reach: Speed of that point (m/s) per speed of the coordinate: its distance in metres from
            the axis of a hinge, 1 for a slide.
        impulse: Impulse (N s) that stops the prop, per speed of the coordinate: the moment of
            inertia about the axis divided by the distance for a hinge, the mass for a slide.
    """

    reach: float
    impulse: float


def joint_stop(cfg: PropCfg) -> JointStop:
    """Return the stop of a prop with a joint, at either end of its range."""
    joint = cfg.joint
    if joint is None:
        raise ValueError(f"prop {cfg.name!r} has no joint")
    if joint.kind is JointKind.slide:
        return JointStop(1.0, cfg.mass_kg)
    axis = np.asarray(joint.axis, np.float64)
    axis = axis / np.linalg.norm(axis)
    anchor = np.asarray(joint.anchor_m, np.float64)
    geoms = prop_geoms(cfg)
    corners = np.array(list(itertools.product(*np.transpose(bounding_box(geoms)))))
    reach = float(_distances_m(corners - anchor, axis).max())
    inertia = prop_inertia(geoms, cfg.mass_kg)
    (centre_m,) = _distances_m((inertia.centre - anchor)[None], axis)
    moment = float(axis @ inertia.matrix @ axis) + cfg.mass_kg * float(centre_m) ** 2
    return JointStop(reach, moment / reach)


def _distances_m(points: Floats, axis: Floats) -> Floats:
    """Return the distances ``(P,)`` of points ``(P, 3)`` from an axis through the origin."""
    distances: Floats = np.linalg.norm(np.cross(points, axis), axis=1)
    return distances

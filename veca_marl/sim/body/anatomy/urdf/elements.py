"""Elements of URDF text, and the frames of inertias in it."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from veca_marl.sim.geometry import Floats, Pose

_GIMBAL_LOCK = 1e-9


def principal_axes(centre: Floats, matrix: Floats) -> Pose:
    """Return the frame in which an inertia is diagonal: Bullet stores the diagonal alone."""
    if _is_diagonal(matrix):
        return Pose(centre, np.eye(3))
    _, axes = np.linalg.eigh(matrix)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Pose(centre, axes)


def axes_of_shape(frames: Iterable[Pose], axes: Pose, matrix: Floats) -> Pose:
    """Return the first of some frames that is a frame of principal axes too, else `axes`."""
    for frame in frames:
        here = np.allclose(frame.position, axes.position, atol=1e-9)
        if here and _is_diagonal(frame.rotation.T @ matrix @ frame.rotation):
            return frame
    return axes


def _is_diagonal(matrix: Floats) -> bool:
    return bool(np.allclose(matrix, np.diag(np.diag(matrix)), atol=1e-12))


def inertial_element(mass_kg: float, axes: Pose, matrix: Floats) -> str:
    """Return the element ``<inertial>`` of a link, in a frame of principal axes."""
    x, y, z = np.diag(axes.rotation.T @ matrix @ axes.rotation)
    return (
        f'<inertial>{origin_element(axes)}<mass value="{mass_kg!r}"/>'
        f'<inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def origin_element(pose: Pose) -> str:
    """Return the element ``<origin>`` of a pose."""
    angles = _roll_pitch_yaw(pose.rotation)
    return f'<origin xyz="{numbers(*pose.position)}" rpy="{numbers(*angles)}"/>'


def _roll_pitch_yaw(r: Floats) -> tuple[float, float, float]:
    """Return the angles of a rotation about the fixed axes x, y and z in this order, rad."""
    pitch = math.asin(min(max(-r[2, 0], -1.0), 1.0))
    if math.hypot(r[2, 1], r[2, 2]) < _GIMBAL_LOCK:  # x is vertical
        return 0.0, pitch, math.atan2(-r[0, 1], r[1, 1])
    return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])


def numbers(*values: float) -> str:
    """Return numbers separated by blanks."""
    return " ".join(f"{value:.12g}" for value in values)

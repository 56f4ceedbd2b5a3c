"""The collision shapes of the links of a body, and its compliant skin over them.

Between two links of several shapes each, Bullet has one contact manifold per pair of shapes, and
solves these in an order that depends on earlier episodes. A link with one shape has one manifold
with each other link, and their order is that of the links.

The skin of hands and feet carries load, so that the depth of penetration depends on the force.
There the compliant layer is a collider of its own over that of the rigid bone, which stops objects
that compress the skin completely. A finger has the compliant collider alone, which saves 30 links:
its own strength cannot compress its skin completely (at most 1.4 N at the tip, against 1.5 to
2 N). The weight of an arm on a fingertip can; the fingertip then penetrates by several millimetres.
All other bones are rigid in the physics.

Touch reads depths from geometry and does not depend on these springs; where the skin is compliant,
its readings vary gradually with the force.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Bone
from veca_marl.sim.geometry import Floats, Pose, Primitive, Shape, rotation_with_z
from veca_marl.sim.physics import urdf_geometry

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


# Bullet adds a margin to every hull (`gDefaultCollisionMargin` of its importer)
MARGIN_M = 0.001
_RINGS, _AROUND = 7, 20  # points of a half sphere: rings from pole to equator, and round each


def surface_points(part: Primitive, pose: Pose) -> Floats:
    """Return points ``(n, 3)`` whose hull is a capsule or a box on a frame at a pose.

    Those of a capsule lie so far out that its surface is inside the hull as often as outside.
    """
    inner = part.grown(-MARGIN_M)
    if part.shape is Shape.BOX:
        local = inner.corners()
    else:
        low, high = part.cap_centres()
        ball = inner.radius * _BULGE * _half_sphere(part.pose.rotation[:, 2])
        local = np.concatenate([high + ball, low - ball])
    points: Floats = pose.position + local @ pose.rotation.T
    return points


def as_obj(points: Floats) -> str:
    """Return points as Wavefront OBJ. Bullet computes the hull; the faces only list all points."""
    rows = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
    last = len(points)
    rows += [f"f {i} {min(i + 1, last)} {min(i + 2, last)}" for i in range(1, last + 1, 3)]
    return "\n".join(rows) + "\n"


def _half_sphere(axis: Floats) -> Floats:
    """Points on the unit half sphere about an axis, including its rim."""
    polar = np.linspace(0.0, math.pi / 2.0, _RINGS)
    around = np.linspace(0.0, 2.0 * math.pi, _AROUND, endpoint=False)
    polar, around = (grid.ravel() for grid in np.meshgrid(polar, around))
    x, y = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)
    points: Floats = np.stack([x, y, np.cos(polar)], axis=1) @ rotation_with_z(axis).T
    return np.unique(points.round(12), axis=0)


# the corners of a ring are as far outside the circle as the middles of its edges are inside
_BULGE = 2.0 / (1.0 + math.cos(math.pi / _AROUND))


class LinkShape(NamedTuple):
    """A shape of a link.

    Attributes:
        pose: Its pose in the link's frame.
        geometry: Its description as URDF.
        points: ``(n, 3)`` metres, points in the link's frame whose hull it is.
    """

    pose: Pose
    geometry: str
    points: Floats


class Layer(NamedTuple):
    """A link with shapes that are all rigid or all soft."""

    link: str
    shapes: Sequence[LinkShape]
    soft: bool


def collision_element(shape: LinkShape) -> str:
    """Return the element ``<collision>`` of a shape."""
    geometry = f"<geometry>{shape.geometry}</geometry>"
    return f"<collision>{origin_element(shape.pose)}{geometry}</collision>"


def rigid_shapes(bone: Bone, pose: Pose) -> list[LinkShape]:
    """Return the rigid primitives of a bone at a pose."""
    return [_shape(part, pose) for part in bone.colliders]


def soft_shapes(bone: Bone, pose: Pose) -> list[LinkShape]:
    """Return the primitives of a bone at a pose with its skin on."""
    return [_shape(part.grown(bone.skin_thickness_m), pose) for part in bone.colliders]


def one_link_per_shape(layer: Layer) -> list[Layer]:
    """Give each shape of a link a link of its own."""
    return [
        Layer(f"{layer.link}__part{i}" if i else layer.link, [_aligned(shape)], layer.soft)
        for i, shape in enumerate(layer.shapes)
    ]


def _shape(part: Primitive, pose: Pose) -> LinkShape:
    centre, turn = part.pose
    place = Pose(pose.position + pose.rotation @ centre, pose.rotation @ turn)
    return LinkShape(place, urdf_geometry(part), surface_points(part, pose))


def _aligned(shape: LinkShape) -> LinkShape:
    """Give a shape along its link's z axis the link's axes: both of its ends are alike."""
    if abs(shape.pose.rotation[2, 2]) == 1.0:
        return shape._replace(pose=Pose(shape.pose.position, np.eye(3)))
    return shape


FINGERS = ("index", "middle", "ring", "little", "thumb")
_DAMPING_RATIO = 0.7
_CARRIED_KG = {True: 0.02, False: 0.5}  # typical load of a finger, of a hand or foot; our choice


class SkinLayer(Enum):
    """Colliders of a bone: the rigid bone, its soft skin, or one over the other."""

    BONE = "bone"
    SKIN = "skin"
    SKIN_OVER_BONE = "skin over bone"


@dataclass(frozen=True)
class SkinSpring:
    """A linear spring per contact point: the force is ``stiffness x depth``.

    Attributes:
        stiffness_npm: N/m: the force that compresses the skin completely, over its thickness.
        damping_nspm: N s/m.
        thickness_m: Depth at which the bone is reached.
    """

    stiffness_npm: float
    damping_nspm: float
    thickness_m: float


def is_finger(bone: Bone) -> bool:
    """Return whether a bone is one of the 30 phalanges."""
    return any(finger in bone.name for finger in FINGERS)


def skin_layer(bone: Bone) -> SkinLayer:
    """Return the kind of colliders of a bone."""
    if is_finger(bone):
        return SkinLayer.SKIN
    return SkinLayer.SKIN_OVER_BONE if bone.name.endswith(("hand", "foot")) else SkinLayer.BONE


def skin_spring(bone: Bone) -> SkinSpring:
    """Return the spring of the skin of a bone."""
    stiffness = bone.skin_force_n / bone.skin_thickness_m
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * _CARRIED_KG[is_finger(bone)])
    return SkinSpring(stiffness, damping, bone.skin_thickness_m)

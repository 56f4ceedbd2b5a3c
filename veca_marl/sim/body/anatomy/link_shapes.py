"""The collision shapes of the links of a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Bone
from veca_marl.sim.body.anatomy.urdf.elements import origin_element
from veca_marl.sim.body.anatomy.urdf.hulls import surface_points
from veca_marl.sim.geometry import Floats, Pose, Primitive
from veca_marl.sim.physics import urdf_geometry


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

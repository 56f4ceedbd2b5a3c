"""The primitives that props are made of, and the boxes among them that stop sound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from veca_marl.sim.geometry import Floats, Geom, Shape
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.physics.props.joint import JointCfg, JointKind
from veca_marl.sim.physics.props.prop_cfg import PartCfg, PropCfg, PropShape, hull_of
from veca_marl.sim.sound.obstacles import Obstacles

_DOLL_SKIN = (0.95, 0.78, 0.65)
_DOLL_HAIR = (0.35, 0.22, 0.12)


def doll_parts(height_m: float) -> list[PartCfg]:
    """Return the parts of a doll that stands with the middle of its height at the origin.

    Its face is turned to x. The proportions are ours; it stands on two flat feet.

    Args:
        height_m: From the feet to the top of the hair.
    """
    h = height_m
    parts = [
        PartCfg(PropShape.sphere, [0.15 * h], (0.0, 0.0, 0.34 * h), colour=_DOLL_SKIN),
        PartCfg(PropShape.sphere, [0.14 * h], (-0.03 * h, 0.0, 0.36 * h), colour=_DOLL_HAIR),
        PartCfg(PropShape.capsule, [0.12 * h, 0.18 * h], (0.0, 0.0, 0.06 * h)),
    ]
    for side in (-1.0, 1.0):
        parts += _limbs(h, side)
    return parts


def _limbs(h: float, side: float) -> list[PartCfg]:
    """Return the arm, the leg and the foot of one side."""
    return [
        PartCfg(
            PropShape.capsule,
            [0.045 * h, 0.22 * h],
            (0.0, side * 0.18 * h, 0.07 * h),
            (-side * 25.0, 0.0, 0.0),
            _DOLL_SKIN,
        ),
        PartCfg(PropShape.capsule, [0.06 * h, 0.2 * h], (0.0, side * 0.075 * h, -0.28 * h)),
        PartCfg(
            PropShape.box,
            [0.2 * h, 0.11 * h, 0.06 * h],
            (0.03 * h, side * 0.075 * h, -0.47 * h),
            colour=_DOLL_HAIR,
        ),
    ]


SOUND_OBSTACLE_M = (0.25, 0.25)
"""Least width and height of a box that attenuates sound. Smaller ones take less than 1.5 dB at
500 Hz from a path of 2 m past their middle. Walls and partitions, which fill openings, attenuate at
any size."""


def prop_geoms(cfg: PropCfg) -> tuple[Geom, ...]:
    """Return the primitives of a prop in its own frame."""
    size = tuple(cfg.size_m)
    surface: dict[str, Any] = {
        "colour": tuple(cfg.colour),
        "checker_m": cfg.checker_m,
        "transparent": cfg.transparent,
        "tangible": cfg.tangible,
    }
    match cfg.shape:
        case PropShape.wall:
            half = tuple(s / 2 for s in size)
            return (Geom(Shape.BOX, half, offset=(0.0, 0.0, half[2]), **surface),)
        case PropShape.goal:
            return _goal_geoms(size, surface)
        case PropShape.doll:
            return _part_geoms(doll_parts(*size), surface)
        case PropShape.compound:
            return _part_geoms(cfg.parts, surface)
        case _:
            return (_single_geom(cfg, surface),)


def sound_obstacles(cfg: PropCfg, geoms: Sequence[Geom]) -> list[Geom]:
    """Return the boxes of a prop that attenuate sound between rooms.

    These are walls, the largest box of a partition, such as the leaf of a door, and large boxes,
    also as parts of a compound, see `SOUND_OBSTACLE_M`.
    """
    if not cfg.tangible:
        return []
    if cfg.shape is PropShape.wall:
        return list(geoms)
    if cfg.partition:
        boxes = [geom for geom in geoms if geom.shape is Shape.BOX]
        return [max(boxes, key=lambda box: box.volume)]
    return [geom for geom in geoms if geom.shape is Shape.BOX and _is_large(geom)]


def horizontal_radius_m(geoms: Sequence[Geom]) -> float:
    """Return the radius of a vertical cylinder about the origin that contains primitives."""
    return max(_reach(geom) for geom in geoms)


def prop_radius_m(cfg: PropCfg, reach_m: float) -> float:
    """Return the horizontal radius of a prop, see `Prop.radius_m`.

    Args:
        cfg: The prop.
        reach_m: Horizontal radius of a vertical cylinder about its origin that contains it.
    """
    size = cfg.size_m
    if cfg.shape in (PropShape.box, PropShape.wall):
        return math.hypot(size[0], size[1]) / 2
    if cfg.shape is PropShape.goal:
        return size[0] / 2
    if cfg.shape in (PropShape.sphere, PropShape.cylinder, PropShape.capsule):
        return size[0]
    return reach_m


def swept_radius_m(geoms: Sequence[Geom], joint: JointCfg) -> float:
    """Return the horizontal distance from the anchor of a joint within which a prop always is.

    Args:
        geoms: The primitives of the prop, in its frame.
        joint: Its joint.

    Returns:
        Metres, for all openings. The distance is exact for a hinge about the vertical and an upper
        bound for all other joints.
    """
    upright = joint.kind is JointKind.hinge and not any(joint.axis[:2])
    axes = slice(2) if upright else slice(3)
    anchor = np.asarray(joint.anchor_m)
    reach_m = max(
        float(np.linalg.norm((_outline(geom) - anchor)[:, axes], axis=1).max()) + _roundness(geom)
        for geom in geoms
    )
    return reach_m if joint.kind is JointKind.hinge else reach_m + joint.range_m


def bounding_box(geoms: Sequence[Geom]) -> tuple[Floats, Floats]:
    """Return the lower and the upper corner of a box about primitives, along their frame's axes."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for geom in geoms:
        points, margin = _outline(geom), _margins(geom, np.eye(3))
        low = np.minimum(low, points.min(axis=0) - margin)
        high = np.maximum(high, points.max(axis=0) + margin)
    return low, high


def lowest_m(geoms: Sequence[Geom], rotation: Floats) -> float:
    """Return the height of the lowest point of primitives above the origin of their frame, metres.

    Args:
        geoms: The primitives.
        rotation: ``(3, 3)`` from their frame to the world's.
    """
    down = -rotation[2]
    return -max(
        float((_outline(geom) @ down).max()) + float(_margins(geom, down[None])[0])
        for geom in geoms
    )


def _single_geom(cfg: PropCfg | PartCfg, surface: dict[str, Any]) -> Geom:
    """Return the primitive of a prop or part of one primitive, about the origin."""
    size = tuple(cfg.size_m)
    match cfg.shape:
        case PropShape.sphere:
            return Geom(Shape.SPHERE, size, **surface)
        case PropShape.box:
            return Geom(Shape.BOX, tuple(s / 2 for s in size), **surface)
        case PropShape.cylinder:
            return Geom(Shape.CYLINDER, size, **surface)
        case PropShape.capsule:
            return Geom(Shape.CAPSULE, size, **surface)
        case _:
            return Geom(Shape.POLYHEDRON, (), hull=hull_of(cfg), **surface)


def _part_geoms(parts: Sequence[PartCfg], surface: dict[str, Any]) -> tuple[Geom, ...]:
    """Return the primitives of parts at their poses."""
    geoms = []
    for part in parts:
        own = surface if part.colour is None else surface | {"colour": tuple(part.colour)}
        pose = {
            "offset": tuple(part.position_m),
            "rotation": rotation_about_axes(part.rotation_deg),
        }
        geoms.append(_single_geom(part, own | pose))
    return tuple(geoms)


def rotation_about_axes(degrees: Sequence[float]) -> Floats:
    """Return the rotation ``(3, 3)`` about the fixed x, then y, then z axis."""
    whole = np.eye(3)
    for axis, angle in enumerate(degrees):
        cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        turn, i, j = np.eye(3), (axis + 1) % 3, (axis + 2) % 3
        turn[i, i] = turn[j, j] = cosine
        turn[i, j], turn[j, i] = -sine, sine
        whole = turn @ whole
    return whole


def _is_large(box: Geom) -> bool:
    """Return whether a box is wide and high enough to attenuate sound."""
    edges = 2.0 * np.abs(np.asarray(box.rotation)) @ np.array(box.size)
    width_m, height_m = SOUND_OBSTACLE_M
    return bool(edges[:2].max() >= width_m and edges[2] >= height_m)


def _outline(geom: Geom) -> Floats:
    """Return points ``(n, 3)``; their hull, with `_roundness` around it, contains a primitive."""
    if geom.shape in (Shape.BOX, Shape.POLYHEDRON):
        return geom.corners()
    return np.stack(geom.cap_centres())


def _roundness(geom: Geom) -> float:
    return 0.0 if geom.shape in (Shape.BOX, Shape.POLYHEDRON) else geom.radius


def _margins(geom: Geom, directions: Floats) -> Floats:
    """Return how far a primitive extends beyond its `_outline` in unit directions, ``(n,)`` metres.

    Args:
        geom: The primitive.
        directions: ``(n, 3)``, in its frame.
    """
    if geom.shape is not Shape.CYLINDER:
        return np.full(len(directions), _roundness(geom))
    along: Floats = directions @ np.asarray(geom.rotation)[:, 2]  # each cap is a disc
    return geom.radius * np.sqrt(np.clip(1.0 - along**2, 0.0, None))


def _reach(geom: Geom) -> float:
    points = _outline(geom)
    return float(np.hypot(points[:, 0], points[:, 1]).max()) + _roundness(geom)


def _goal_geoms(size: tuple[float, ...], surface: dict[str, Any]) -> tuple[Geom, ...]:
    """Two posts and a bar; the opening of the goal faces x, its width lies along y."""
    width, height, radius = size
    posts = [
        Geom(
            Shape.CYLINDER, (radius, height), offset=(0.0, side * width / 2, height / 2), **surface
        )
        for side in (-1.0, 1.0)
    ]
    along_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    bar = Geom(
        Shape.CYLINDER, (radius, width), offset=(0.0, 0.0, height), rotation=along_y, **surface
    )
    return (*posts, bar)


class SoundObstacle(Protocol):
    """A box that follows the pose of its prop."""

    def move(self, position: Floats, rotation: Floats) -> None:
        """Follow the frame of the prop: its origin ``(3,)`` metres and axes ``(3, 3)``."""
        ...


def make_obstacles(
    boxes: Sequence[Geom],
    cfg: PropCfg,
    body_id: int,
    client: BulletClient,
    obstacles: Obstacles,
) -> list[SoundObstacle]:
    """Add the boxes of a prop to the obstacles of the sound.

    Args:
        boxes: In the frame of the prop.
        cfg: The prop. With a joint it is a leaf.
        body_id: PyBullet's id of the prop.
        client: The PyBullet client.
        obstacles: Those of its world.
    """
    if cfg.joint is None:
        return [_FreeBox(box, cfg.mass_kg == 0.0, obstacles) for box in boxes]
    return [_Leaf(box, cfg.joint, body_id, client, obstacles) for box in boxes]


class _FreeBox:
    """A box of a prop without a joint."""

    def __init__(self, box: Geom, fixed: bool, obstacles: Obstacles) -> None:
        self._offset, self._turn = np.asarray(box.offset), np.asarray(box.rotation)
        self._obstacles = obstacles
        self._number = obstacles.add(box.size, fixed)

    def move(self, position: Floats, rotation: Floats) -> None:
        """See `SoundObstacle`."""
        self._obstacles.move(
            self._number, position + rotation @ self._offset, rotation @ self._turn
        )


class _Leaf:
    """A box of a prop with a joint, and the opening that it closes."""

    def __init__(
        self, box: Geom, joint: JointCfg, body_id: int, client: BulletClient, obstacles: Obstacles
    ) -> None:
        self._offset, self._turn = np.asarray(box.offset), np.asarray(box.rotation)
        self._anchor = np.asarray(joint.anchor_m, np.float64)
        self._body_id, self._client = body_id, client
        self._obstacles = obstacles
        self._number = obstacles.add_leaf(box.size)
        self._base: tuple[object, ...] = ()

    def move(self, position: Floats, rotation: Floats) -> None:
        """See `SoundObstacle`."""
        self._obstacles.move_leaf(
            self._number, position + rotation @ self._offset, rotation @ self._turn
        )
        base = self._client.getBasePositionAndOrientation(self._body_id)
        if base != self._base:
            self._base = base
            self._move_opening(*base)

    def _move_opening(self, anchor: Sequence[float], quaternion: Sequence[float]) -> None:
        """Follow the base of the body: it is at the anchor, with the axes of the closed prop."""
        axes = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        centre = np.array(anchor) + axes @ (self._offset - self._anchor)
        self._obstacles.move_opening(self._number, centre, axes @ self._turn)

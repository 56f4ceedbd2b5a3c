"""Primitive shapes: spheres, boxes, cylinders, capsules and convex polyhedra on a frame.

Bones, props, collision shapes, drawn surfaces and obstacles are all made of these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry.polyhedra import Polyhedron
from veca_marl.sim.geometry.poses import Floats, Pose, rotation_with_z, single
from veca_marl.sim.kernels import kernel


class Shape(IntEnum):
    """The kinds of primitives; compiled loops compare the numbers."""

    SPHERE = 0
    BOX = 1
    CYLINDER = 2
    CAPSULE = 3
    POLYHEDRON = 4


SIZE_NAMES: dict[Shape, tuple[str, ...]] = {
    Shape.SPHERE: ("radius",),
    Shape.BOX: ("half x", "half y", "half z"),
    Shape.CYLINDER: ("radius", "length"),
    Shape.CAPSULE: ("radius", "length"),
    Shape.POLYHEDRON: (),
}


@dataclass(frozen=True, eq=False)
class Primitive:
    """A primitive on a frame.

    Attributes:
        shape: What it is.
        size: Metres. Sphere ``(radius,)``; box half extents ``(x, y, z)``; cylinder and capsule
            ``(radius, length)`` along the local z axis, where the length of a capsule is the
            distance between the centres of its caps, as in PyBullet and URDF; polyhedron ``()``.
        offset: ``(3,)`` metres from the frame's origin to the primitive's centre; of a polyhedron
            to the origin of its vertices.
        rotation: ``(3, 3)`` from the primitive's axes to the frame's.
        hull: The polyhedron; None for all other shapes.

    Raises:
        ValueError: If a size is not positive, the number of sizes is not that of the shape, the
            offset is not finite, the rotation is not a rotation, or `hull` does not fit the shape.
    """

    shape: Shape
    size: tuple[float, ...]
    offset: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike = field(default_factory=lambda: np.eye(3))
    hull: Polyhedron | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Check the numbers."""
        if (self.hull is None) == (Shape(self.shape) is Shape.POLYHEDRON):
            raise ValueError(
                f"{Shape(self.shape).name}: hull={self.hull}; a POLYHEDRON has one, no other shape"
            )
        names = SIZE_NAMES[Shape(self.shape)]
        if len(self.size) != len(names) or not all(0.0 < s < np.inf for s in self.size):
            raise ValueError(
                f"{Shape(self.shape).name} size {self.size}: must be positive {', '.join(names)}"
            )
        offset, rotation = np.asarray(self.offset, float), np.asarray(self.rotation, float)
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise ValueError(f"offset {self.offset}: must be three finite metres")
        if not _is_rotation(rotation):
            raise ValueError(
                f"rotation {rotation.tolist()}: must be an orthonormal right-handed matrix"
            )

    @property
    def pose(self) -> Pose:
        """Where the primitive is on its frame."""
        return Pose(np.asarray(self.offset, np.float64), np.asarray(self.rotation, np.float64))

    @property
    def radius(self) -> float:
        """Metres; raises `ValueError` for boxes and polyhedra, which have none."""
        if self.shape in (Shape.BOX, Shape.POLYHEDRON):
            raise ValueError(f"a {self.shape.name} has no radius")
        return self.size[0]

    @property
    def length(self) -> float:
        """Metres along z: of a cylinder, or between the centres of a capsule's caps; else 0."""
        return self.size[1] if self.shape in (Shape.CYLINDER, Shape.CAPSULE) else 0.0

    @property
    def volume(self) -> float:
        """Cubic metres."""
        if self.hull is not None:
            return self.hull.volume
        if self.shape is Shape.BOX:
            return float(8.0 * np.prod(self.size))
        cylinder = math.pi * self.radius**2 * self.length
        caps = 0.0 if self.shape is Shape.CYLINDER else 4.0 / 3.0 * math.pi * self.radius**3
        return cylinder + caps

    def cap_centres(self) -> tuple[Floats, Floats]:
        """Return the lower and the upper end of the axis, ``(3,)`` metres each, in the frame."""
        centre, rotation = self.pose
        half = 0.5 * self.length * rotation[:, 2]
        return centre - half, centre + half

    def corners(self) -> Floats:
        """Return the corners of a box ``(8, 3)`` or polyhedron ``(V, 3)``, metres in the frame."""
        centre, rotation = self.pose
        if self.hull is not None:
            vertices: Floats = centre + self.hull.vertices @ rotation.T
            return vertices
        if self.shape is not Shape.BOX:
            raise ValueError(f"a {self.shape.name} has no corners")
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        corners: Floats = centre + (signs * self.size) @ rotation.T
        return corners

    def grown(self, by_m: float) -> Self:
        """Return the same primitive with all of its surface moved outward, corners kept sharp."""
        if self.hull is not None:
            return replace(self, hull=self.hull.grown(by_m))
        size = tuple(value + by_m for value in self.size)
        if self.shape is Shape.CYLINDER:
            size = (self.size[0] + by_m, self.size[1] + 2.0 * by_m)
        elif self.shape is Shape.CAPSULE:
            size = (self.size[0] + by_m, self.size[1])
        return replace(self, size=size)


def capsule_between(start: ArrayLike, end: ArrayLike, radius: float) -> Primitive:
    """Return a capsule by the centres of its caps, ``(3,)`` metres each, from below to above."""
    low, high = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(high - low))
    turn = rotation_with_z((high - low) / length)
    return Primitive(Shape.CAPSULE, (radius, length), (low + high) / 2.0, turn)


_UNIT = np.eye(3)
_ROUNDING = 1e-6 + 1e-5 * _UNIT


def _is_rotation(matrix: NDArray[np.float64]) -> bool:
    """Whether a matrix is 3x3, orthonormal and right-handed."""
    if matrix.shape != (3, 3) or not (np.abs(matrix @ matrix.T - _UNIT) <= _ROUNDING).all():
        return False
    return bool(np.linalg.det(matrix) > 0.0)


_SPHERE, _BOX, _POLYHEDRON = int(Shape.SPHERE), int(Shape.BOX), int(Shape.POLYHEDRON)
_HALF = single(0.5)


@kernel
def bounding_radius(shape: int, size: NDArray[np.float32]) -> float:
    """Radius of a sphere about the centre that contains the primitive."""
    if shape == _SPHERE:
        return float(size[0])
    if shape == _BOX:
        return math.sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2])
    if shape == _POLYHEDRON:
        return float(size[2])  # see `polyhedra.sizes_of`
    return float(size[0] + _HALF * size[1])


class Inertia(NamedTuple):
    """Mass properties of a rigid part in some frame.

    Attributes:
        mass_kg: Mass.
        centre: ``(3,)`` centre of mass, metres.
        matrix: ``(3, 3)`` moment of inertia about the centre of mass, kg m^2.
    """

    mass_kg: float
    centre: Floats
    matrix: Floats


def primitive_inertia(primitive: Primitive, mass_kg: float) -> Inertia:
    """Return the inertia of a primitive of even density, in the frame that it is on."""
    centre, rotation = primitive.pose
    if primitive.hull is not None:
        hull = primitive.hull
        middle = centre + rotation @ hull.centroid
        return Inertia(mass_kg, middle, rotation @ hull.inertia(mass_kg) @ rotation.T)
    if primitive.shape is Shape.BOX:
        squares = (2.0 * np.array(primitive.size)) ** 2
        diagonal = mass_kg / 12.0 * np.diag(squares.sum() - squares)
        return Inertia(mass_kg, centre, rotation @ diagonal @ rotation.T)
    along, across = _moments(primitive, mass_kg)
    axis = rotation[:, 2]
    matrix = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    return Inertia(mass_kg, centre, matrix)


def joined_inertia(parts: Sequence[tuple[Pose, Inertia]]) -> Inertia:
    """Return the inertia of rigidly joined parts (parallel axis theorem).

    Args:
        parts: The pose of each part in the common frame, and its inertia in its own.
    """
    mass = sum(part.mass_kg for _, part in parts)
    centres = [pose.position + pose.rotation @ part.centre for pose, part in parts]
    centre = sum((p.mass_kg * c for (_, p), c in zip(parts, centres, strict=True)), np.zeros(3))
    centre /= mass
    matrix = np.zeros((3, 3))
    for (pose, part), own_centre in zip(parts, centres, strict=True):
        away = own_centre - centre
        matrix += pose.rotation @ part.matrix @ pose.rotation.T
        matrix += part.mass_kg * (away @ away * np.eye(3) - np.outer(away, away))
    return Inertia(mass, centre, matrix)


def _moments(primitive: Primitive, mass_kg: float) -> tuple[float, float]:
    """Return the moments about the axis and across it: a cylinder with two half balls as caps."""
    length, radius = primitive.length, primitive.radius
    cylinder = math.pi * radius**2 * length
    caps = 0.0 if primitive.shape is Shape.CYLINDER else 4.0 / 3.0 * math.pi * radius**3
    tube_kg = mass_kg * cylinder / (cylinder + caps)
    caps_kg = mass_kg - tube_kg
    along = tube_kg * radius**2 / 2.0 + caps_kg * 0.4 * radius**2
    across = tube_kg * (length**2 / 12.0 + radius**2 / 4.0)
    across += caps_kg * (0.4 * radius**2 + length**2 / 4.0 + 0.375 * length * radius)
    return along, across

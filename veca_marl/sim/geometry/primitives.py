"""Primitive shapes: spheres, boxes, cylinders and capsules, on the frames of objects."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry.vectors import single


class Shape(IntEnum):
    """The primitives the eyes can draw."""

    SPHERE = 0
    BOX = 1
    CYLINDER = 2
    CAPSULE = 3


_SIZE_WORDS = {
    Shape.SPHERE: ("radius",),
    Shape.BOX: ("half x", "half y", "half z"),
    Shape.CYLINDER: ("radius", "length"),
    Shape.CAPSULE: ("radius", "length"),
}


@dataclass(frozen=True, eq=False)
class Geom:
    """One primitive on a frame.

    Attributes:
        shape: What it is.
        size: Metres. Sphere ``(radius,)``; box half extents ``(x, y, z)``; cylinder and capsule
            ``(radius, length)`` along the local z axis, where the length of a capsule is the
            distance between the centres of its caps, as in PyBullet.
        colour: ``(red, green, blue)`` in [0, 1].
        offset: ``(3,)`` metres from the frame's origin to the primitive's centre.
        rotation: ``(3, 3)`` from the primitive's axes to the frame's.
        checker_m: Edge of the checker pattern on its surface; 0 for a plain colour.
        transparent: Tints what lies behind it and hides nothing.
        visible: Whether eyes see it; bones under a skin only cast shadows.
        tangible: Whether it can be touched.
        skin_m: Thickness of the flexible skin that makes its outer layer; 0 for rigid things.

    Raises:
        ValueError: If a number is not possible.
    """

    shape: Shape
    size: tuple[float, ...]
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    offset: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike = field(default_factory=lambda: np.eye(3))
    checker_m: float = 0.0
    transparent: bool = False
    visible: bool = True
    tangible: bool = True
    skin_m: float = 0.0

    def __post_init__(self) -> None:
        words = _SIZE_WORDS[Shape(self.shape)]
        if len(self.size) != len(words) or not all(0.0 < s < np.inf for s in self.size):
            raise ValueError(
                f"{Shape(self.shape).name} size {self.size}: want positive {', '.join(words)}"
            )
        if len(self.colour) != 3 or not all(0.0 <= c <= 1.0 for c in self.colour):
            raise ValueError(f"colour {self.colour}: want three numbers in [0, 1]")
        offset, rotation = np.asarray(self.offset, float), np.asarray(self.rotation, float)
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise ValueError(f"offset {self.offset}: want three finite metres")
        if not _is_rotation(rotation):
            raise ValueError(f"rotation {self.rotation}: want an orthonormal right-handed matrix")
        if not 0.0 <= self.checker_m < np.inf:
            raise ValueError(f"checker_m {self.checker_m}: want 0 (plain) or an edge in metres")
        if not 0.0 <= self.skin_m < np.inf:
            raise ValueError(f"skin_m {self.skin_m}: want 0 (rigid) or a thickness in metres")


def _is_rotation(matrix: NDArray[np.float64]) -> bool:
    """Whether a matrix is 3x3, orthonormal and right-handed."""
    if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
        return False
    return bool(np.linalg.det(matrix) > 0.0)


_SPHERE, _BOX = int(Shape.SPHERE), int(Shape.BOX)
_HALF = single(0.5)


@njit(cache=True, error_model="numpy")
def bounding_radius(shape: int, size: NDArray[np.float32]) -> float:
    """Radius of a sphere about the centre that holds the primitive."""
    if shape == _SPHERE:
        return float(size[0])
    if shape == _BOX:
        return math.sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2])
    return float(size[0] + _HALF * size[1])

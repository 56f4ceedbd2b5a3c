"""A loft: rings of vertices joined by bands of triangles and closed by caps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Bone, Skeleton
from veca_marl.sim.body.anatomy.skin_mesh.profiles import Ring
from veca_marl.sim.geometry import Floats


class Loft:
    """Collects vertices, each in the frame of one bone, and triangles, each of one bone."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self.owners: list[int] = []
        self.points: list[Floats] = []
        self.triangles: list[tuple[int, int, int]] = []
        self.triangle_bones: list[int] = []

    def point(self, bone: str, point: Sequence[float] | Floats) -> int:
        """Add a vertex ``(3,)`` in the frame of a bone, metres; return its number."""
        self.owners.append(self._skeleton.bone(bone))
        self.points.append(np.array(point, float))
        return len(self.points) - 1

    def ring(self, bone: str, points: Floats) -> list[int]:
        """Add vertices ``(n, 3)``; return their numbers."""
        return [self.point(bone, point) for point in points]

    def band(self, bone: str, low: list[int], high: list[int]) -> None:
        """Join two rings that run counter-clockwise about the axis from `low` to `high`.

        The quadrilaterals of the second half are split along the other diagonal: the band of two
        mirror-symmetric rings is mirror-symmetric.
        """
        count = len(low)
        for i in range(count):
            j = (i + 1) % count
            if i < count // 2:
                self._add(bone, (low[i], high[j], high[i]), (low[i], low[j], high[j]))
            else:
                self._add(bone, (low[i], low[j], high[i]), (low[j], high[j], high[i]))

    def cap(self, bone: str, ring: list[int], pole: Sequence[float], above: bool) -> None:
        """Close a ring with a point above or below it."""
        top = self.point(bone, pole)
        for i in range(len(ring)):
            j = (i + 1) % len(ring)
            self._add(bone, (top, ring[i], ring[j]) if above else (top, ring[j], ring[i]))

    def _add(self, bone: str, *triangles: tuple[int, int, int]) -> None:
        self.triangles += triangles
        self.triangle_bones += [self._skeleton.bone(bone)] * len(triangles)

    def mirror(self, first_vertex: int, first_triangle: int) -> None:
        """Append the mirror image of the left side, which begins at these numbers."""
        shift = len(self.points) - first_vertex
        right = {i: self._skeleton.bone("r_" + b.name[2:]) for i, b in _left_bones(self._skeleton)}
        self.owners += [right[owner] for owner in self.owners[first_vertex:]]
        self.points += [point * (1.0, -1.0, 1.0) for point in self.points[first_vertex:]]
        turned = [(a + shift, c + shift, b + shift) for a, b, c in self.triangles[first_triangle:]]
        self.triangles += turned
        self.triangle_bones += [right[bone] for bone in self.triangle_bones[first_triangle:]]


def _left_bones(skeleton: Skeleton) -> list[tuple[int, Bone]]:
    return [(i, bone) for i, bone in enumerate(skeleton.bones) if bone.name.startswith("l_")]


def circle(count: int, phase: float) -> Floats:
    """Points ``(count, 2)`` of a polygon round the unit circle, whose edges touch it."""
    angles = (np.arange(count) + phase) * 2.0 * math.pi / count
    points: Floats = np.stack([np.cos(angles), np.sin(angles)], 1) / math.cos(math.pi / count)
    return points


def horizontal_ring(sectors: int, ring: Ring, phase: float = 0.5) -> Floats:
    """Points ``(sectors, 3)`` of a ring parallel to the xy plane."""
    height, half_x, half_y, shift_x = ring
    x, y = circle(sectors, phase).T
    return np.stack([half_x * x + shift_x, half_y * y, np.full(sectors, height)], 1)

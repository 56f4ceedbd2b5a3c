"""The rigid bones under the skin of a body, in the axes of a primitive that presses on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import (
    DistanceAndGradient,
    Floats,
    GeomTable,
    Indices,
    SceneObject,
    Shape,
    Vector,
    distance,
    distance_and_gradient,
)
from veca_marl.sim.kernels import inlined, kernel

_SPHERE, _BOX = int(Shape.SPHERE), int(Shape.BOX)
_CYLINDER, _CAPSULE = int(Shape.CYLINDER), int(Shape.CAPSULE)
_POLYHEDRON = int(Shape.POLYHEDRON)
_FAR_M = 1e9
# columns of a row of placed bones: shape, size, position, and the three axes
PLACED_COLUMNS = 16


class RigidBones(NamedTuple):
    """The primitives of a body's bones, as rows of the scene's table.

    Attributes:
        rows: Rows of the tangible primitives of the body, sorted by bone.
        first: ``(48,)`` the primitives of bone b are ``rows[first[b] : first[b + 1]]``.
        placed: ``(most primitives of a bone, 16)`` buffer, see `place_bone`.
    """

    rows: Indices
    first: Indices
    placed: Floats


def rigid_bones(geoms: GeomTable, body: SceneObject, count: int) -> RigidBones:
    """Return the primitives of the bones of a body.

    Args:
        geoms: The table of the body's scene.
        body: The body, one frame for each bone.
        count: Number of bones.
    """
    rows = np.arange(body.geoms.start, body.geoms.stop)[geoms.tangible[body.geoms]]
    bones = geoms.frames[rows] - body.rows.start
    order = np.argsort(bones, kind="stable")
    first = np.searchsorted(bones[order], np.arange(count + 1))
    return RigidBones(rows[order], first, np.zeros((int(np.diff(first).max()), PLACED_COLUMNS)))


@inlined
def shrunk(shape: int, size: Vector, by: float) -> Vector:
    """Return the size of a primitive with all of its surface moved inward, cf. `grown`.

    Polyhedra have no skin: their size is returned as it is.
    """
    if shape == _POLYHEDRON:
        return size
    if shape == _BOX:
        return size[0] - by, size[1] - by, size[2] - by
    if shape == _CYLINDER:
        return size[0] - by, size[1] - 2.0 * by, 0.0
    return size[0] - by, size[1], 0.0


@kernel
def place_bone(
    geoms: GeomTable, bones: RigidBones, bone: int, rotation: Floats, origin: Floats
) -> int:
    """Write the rigid primitives of a bone in the axes of another primitive to `bones.placed`.

    Args:
        geoms: The scene's primitives. Those of bones include the skin, which is taken off.
        bones: The bones of the body.
        bone: Which bone.
        rotation: ``(3, 3)`` from the axes of the other primitive to the world's.
        origin: ``(3,)`` metres, its centre.

    Returns:
        The number of rows written.
    """
    first, end = bones.first[bone], bones.first[bone + 1]
    for i in range(first, end):
        g, out = bones.rows[i], bones.placed[i - first]
        skin, shape, s = geoms.skins[g], geoms.shapes[g], geoms.sizes[g]
        out[0] = shape
        out[1], out[2], out[3] = shrunk(shape, (float(s[0]), float(s[1]), float(s[2])), skin)
        for row in range(3):
            out[4 + row] = 0.0
            for k in range(3):
                out[4 + row] += rotation[k, row] * (geoms.positions[g, k] - origin[k])
            for axis in range(3):
                out[7 + 3 * axis + row] = 0.0
                for k in range(3):
                    out[7 + 3 * axis + row] += rotation[k, row] * geoms.rotations[g, k, axis]
    return int(end - first)


@inlined
def distance_to_placed(placed: Floats, count: int, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point from the first `count` placed primitives."""
    nearest = _FAR_M
    for row in range(count):
        shape, size, (a, b, c) = _local(placed, row, x, y, z)
        nearest = min(nearest, distance(shape, size, a, b, c))
    return nearest


@kernel
def is_farther(shape: int, size: Vector, placed: Floats, count: int, reach: float) -> bool:
    """Return whether a primitive is certainly farther than `reach` from the placed ones.

    A lower bound of their distance: the distances of points on the axis of a sphere or capsule,
    less its radius and less the longest way along the axis to one of the points.

    Args:
        shape: The `Shape` of the primitive.
        size: Its size.
        placed: Primitives in its axes, as from `place_bone`.
        count: Their number.
        reach: Metres.
    """
    if shape in (_SPHERE, _CAPSULE):
        quarter = 0.125 * size[1]
        for i in range(4):
            z = (2 * i - 3) * quarter
            if distance_to_placed(placed, count, 0.0, 0.0, z) <= reach + size[0] + quarter:
                return False
        return True
    for row in range(count):
        q = placed[row]
        if int(q[0]) not in (_SPHERE, _CAPSULE):
            return False
        quarter = 0.125 * q[2]
        for i in range(4):
            z = (2 * i - 3) * quarter
            x, y, z = q[4] + z * q[13], q[5] + z * q[14], q[6] + z * q[15]
            if distance(shape, size, x, y, z) <= reach + q[1] + quarter:
                return False
    return True


@kernel
def moved_to_height(placed: Floats, count: int, point: Vector, height: float) -> Vector:
    """Return a point moved along the gradient of the distance from a bone to a given distance.

    Args:
        placed: The bone, as from `place_bone`.
        count: Number of its primitives.
        point: The point, in the same axes.
        height: Metres from the bone; negative inside.
    """
    x, y, z = point
    best, nearest = 0, _FAR_M
    slope: DistanceAndGradient = (0.0, 0.0, 0.0, 0.0)
    for row in range(count):
        shape, size, (a, b, c) = _local(placed, row, x, y, z)
        candidate: DistanceAndGradient = distance_and_gradient(shape, size, a, b, c)
        if candidate[0] < nearest:
            best, nearest, slope = row, candidate[0], candidate
    q, way = placed[best], height - nearest
    return (
        x + way * (q[7] * slope[1] + q[10] * slope[2] + q[13] * slope[3]),
        y + way * (q[8] * slope[1] + q[11] * slope[2] + q[14] * slope[3]),
        z + way * (q[9] * slope[1] + q[12] * slope[2] + q[15] * slope[3]),
    )


@inlined
def _local(placed: Floats, row: int, x: float, y: float, z: float) -> tuple[int, Vector, Vector]:
    """Return shape and size of a placed primitive, and a point in its own axes."""
    q = placed[row]
    x, y, z = x - q[4], y - q[5], z - q[6]
    point = (
        q[7] * x + q[8] * y + q[9] * z,
        q[10] * x + q[11] * y + q[12] * z,
        q[13] * x + q[14] * y + q[15] * z,
    )
    return int(q[0]), (q[1], q[2], q[3]), point

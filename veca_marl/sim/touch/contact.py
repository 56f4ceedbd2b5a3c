"""The reading of one taxel from one primitive: the column of skin and the receptive field.

The skin of a bone is equally thick in all directions, so that the layer on a bone with edges is
round there: the points within its thickness of the bone. Spheres and capsules stay what they are,
with a greater radius.

All lengths are metres in the axes of the primitive. The skin at a taxel is a column of length t
that starts at the base b on the rigid bone and runs along the normal n of the taxel's triangle.
For the definition of the reading see `veca_marl.sim.touch.penetration`.
"""

from __future__ import annotations

from typing import NamedTuple

from veca_marl.sim.geometry import (
    DistanceAndGradient,
    Floats,
    Shape,
    Solid,
    Vector,
    solid_distance,
    solid_entry,
    solid_gradient,
)
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.touch.rigid_bones import distance_to_placed, moved_to_height, shrunk

_BOX, _CYLINDER = int(Shape.BOX), int(Shape.CYLINDER)
_SURFACE_M = 1e-7  # a ray that is so near has entered
_STEPS = 100  # of a ray; one that grazes the solid takes most


class PressingSolid(NamedTuple):
    """A solid and a layer around it, metres in the axes of the primitive.

    Attributes:
        core: The primitive without the layer, see `solid_of`.
        layer: Metres of skin around it; 0 where the skin is part of the core.
    """

    core: Solid
    layer: float


@inlined
def core_and_layer(shape: int, size: Vector, skin: float, kept: float) -> tuple[Vector, float]:
    """Return the size of the core of a primitive, and the layer of skin around it.

    Args:
        shape: A `Shape`.
        size: Its size with all of its skin.
        skin: Metres of skin.
        kept: Metres of them that belong to the pressing solid.
    """
    if shape in (_BOX, _CYLINDER):
        return shrunk(shape, size, skin), kept
    return shrunk(shape, size, skin - kept), 0.0


@inlined
def pressing_distance(pressing: PressingSolid, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point, metres."""
    return solid_distance(pressing.core, x, y, z) - pressing.layer


@inlined
def pressing_gradient(pressing: PressingSolid, x: float, y: float, z: float) -> DistanceAndGradient:
    """Return the signed distance of a point and its gradient, see `distance_and_gradient`."""
    slope: DistanceAndGradient = solid_gradient(pressing.core, x, y, z)
    return slope[0] - pressing.layer, slope[1], slope[2], slope[3]


@inlined
def pressing_entry(pressing: PressingSolid, point: Vector, way: Vector, reach: float) -> float:
    """Return the distance along a ray from outside to where it enters.

    Args:
        pressing: The solid.
        point: Start of the ray.
        way: Its unit vector.
        reach: Metres.

    Returns:
        Metres; `reach` or more if it does not enter before.
    """
    if pressing.layer > 0.0:
        return _traced_entry(pressing, point, way, reach)
    return float(solid_entry(pressing.core, point, way))


@kernel
def _traced_entry(pressing: PressingSolid, point: Vector, way: Vector, reach: float) -> float:
    """Follow a ray by its distance from the solid (sphere tracing; Hart, Visual Computer 1996)."""
    (x, y, z), (u, v, w) = point, way
    gone = 0.0
    for _ in range(_STEPS):
        away = pressing_distance(pressing, x + gone * u, y + gone * v, z + gone * w)
        if away <= _SURFACE_M:
            return gone
        gone += away
        if gone >= reach:
            break
    return reach


class Column(NamedTuple):
    """What the taxels of one bone have in common, compared with one primitive.

    Attributes:
        solid: The primitive with `inset` of its own skin on.
        length: Metres, t: thickness of the skin, of both skins if the primitive has one.
        depth: Metres from the sensing point down to the base.
        inset: Metres of the primitive's own skin that count as part of it; columns start that
            much inside the bone.
        bones: Number of rows of placed bones, see `place_bone`.
    """

    solid: PressingSolid
    length: float
    depth: float
    inset: float
    bones: int


@inlined
def taxel_reading(
    column: Column, placed: Floats, base: Vector, normal: Vector, radius: float, known: float
) -> float:
    """Return the reading of a taxel, at least `known`.

    Args:
        column: The primitive and the skin.
        placed: The rigid bone below the taxel, see `place_bone`.
        base: b.
        normal: n.
        radius: R, of the receptive field; 0 for a point.
        known: The largest reading from other primitives.
    """
    away = pressing_distance(column.solid, base[0], base[1], base[2])
    if away <= 0.0:
        if known < 1.0:
            known = max(_reading_around(column, placed, base, normal, radius, away), known)
        return known
    if away * away >= column.length * column.length + radius * radius:
        return known
    if radius > 0.0:
        known = _field_reading(column, placed, base, normal, radius, known)
    if 1.0 - away / column.length > known:  # the ray enters no nearer than the nearest point
        known = _column_reading(column, placed, base, normal, known)
    return known


@kernel
def _reading_around(
    column: Column, placed: Floats, base: Vector, normal: Vector, radius: float, away: float
) -> float:
    """Return the reading of a taxel with its base inside the primitive.

    The ray enters at b, and b is also the nearest point m. The field is computed once more with b
    moved onto the bone, where the skin is fully displaced if that point is inside too.
    """
    height = distance_to_placed(placed, column.bones, base[0], base[1], base[2])
    if away + abs(height + column.inset) <= 0.0:  # wherever it is moved to, it is inside
        return 1.0
    moved = moved_to_height(placed, column.bones, base, -column.inset)
    if pressing_distance(column.solid, moved[0], moved[1], moved[2]) <= 0.0:
        return 1.0
    slope: DistanceAndGradient = pressing_gradient(column.solid, base[0], base[1], base[2])
    against = -(slope[1] * normal[0] + slope[2] * normal[1] + slope[3] * normal[2])
    straight = min(max(against, 0.0), 1.0) ** 2
    share = min(max(1.0 - (height + column.inset) / column.length, 0.0), 1.0)
    reading = max(min(straight, share), share * (1.0 - (1.0 - share) * (1.0 - straight)))
    if radius > 0.0:
        reading = _field_reading(column, placed, moved, normal, radius, reading)
    return reading


@inlined
def _pressed_share(column: Column, placed: Floats, x: float, y: float, z: float) -> float:
    """Return how much of the true skin of the bone is displaced below a point, in [0, 1]."""
    height = distance_to_placed(placed, column.bones, x, y, z) + column.inset
    return min(max(1.0 - height / column.length, 0.0), 1.0)


@kernel
def _column_reading(
    column: Column, placed: Floats, base: Vector, normal: Vector, known: float
) -> float:
    """Return ``C = min((1 - e / t) cos(a)^2, x_e)`` or, if that is larger, `known`."""
    (x, y, z), (u, v, w) = base, normal
    entry = pressing_entry(column.solid, base, normal, column.length)
    share = 1.0 - entry / column.length
    if share <= known:
        return known
    x, y, z = x + entry * u, y + entry * v, z + entry * w
    slope: DistanceAndGradient = pressing_gradient(column.solid, x, y, z)
    against = max(-(slope[1] * u + slope[2] * v + slope[3] * w), 0.0)
    share *= min(against * against, 1.0)
    if share <= known:
        return known
    return max(min(share, _pressed_share(column, placed, x, y, z)), known)


@kernel
def _field_reading(
    column: Column, placed: Floats, base: Vector, normal: Vector, radius: float, known: float
) -> float:
    """Return ``F = x (1 - (1 - x) sin(f)^2) (1 - (q / R)^2)^2`` or, if larger, `known`.

    The base has to be outside of the primitive.
    """
    (x, y, z), (u, v, w) = base, normal
    slope: DistanceAndGradient = pressing_gradient(column.solid, x, y, z)
    away = slope[0]
    ahead = -(slope[1] * u + slope[2] * v + slope[3] * w)
    height = away * ahead
    beyond = height - min(max(height, 0.0), column.length)
    beside = away * away * max(1.0 - ahead * ahead, 0.0) + beyond * beyond
    if beside >= radius * radius:
        return known
    weight = (1.0 - beside / (radius * radius)) ** 2
    if weight <= known:
        return known
    share = _pressed_share(
        column, placed, x - away * slope[1], y - away * slope[2], z - away * slope[3]
    )
    oblique = 1.0 - min(max(ahead, 0.0), 1.0) ** 2
    return max(weight * share * (1.0 - (1.0 - share) * oblique), known)

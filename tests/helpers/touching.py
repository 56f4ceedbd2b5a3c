"""A scene with a body and primitives in contact with it, and a dense reference for the taxels."""

from dataclasses import dataclass

import numpy as np
from skins import add_body, pose
from stand_in_worlds import SceneWorld

from veca_marl.sim.body.anatomy import REFERENCE, Growth, load_skeleton
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.touch import TouchCfg, TouchSense, load_taxels, taxel_positions
from veca_marl.sim.touch.touch_sense import own_overlaps, unsensed_primitives

FIELD = TouchCfg().receptive_field
# arms away from the trunk: nothing of the body touches the body
SPREAD = np.zeros(82)
for _side in "lr":
    SPREAD[load_skeleton().joint(f"{_side}_upper_arm", "abduction")] = 0.8


@dataclass
class Named:
    """The attributes of a body that `TouchSense` uses."""

    name: str
    object_id: int
    growth: Growth = REFERENCE


class Stage:
    """A body in a scene of its own."""

    def __init__(self, angles=SPREAD, cfg=None, position=(0.0, 0.0, 0.0), rotation=None):
        self.scene = Scene()
        self.body = add_body(self.scene)
        pose(self.body, angles, position, rotation)
        self.sense = TouchSense(
            cfg or TouchCfg(), Named("body", self.body.id), SceneWorld(self.scene)
        )

    def add(self, shape, size, position, rotation=None, skin_m=0.0):
        geom = Geom(Shape[shape], size, skin_m=skin_m)
        thing = self.scene.add_object(f"{shape} {len(self.scene.objects)}", [[geom]])
        thing.positions[0] = position
        thing.rotations[0] = np.eye(3) if rotation is None else rotation
        return thing

    def read(self):
        """Readings ``(1648, 6)``."""
        self.scene.update()
        return self.sense.update_taxels().copy()

    def bone(self, name):
        return load_skeleton().bone(name)

    def at(self, bone, point):
        """World position of a point in a bone's frame."""
        index = self.bone(bone)
        return self.body.positions[index] + self.body.rotations[index] @ point


def of_bone(readings, name):
    first, bone = load_taxels().first_triangle, load_skeleton().bone(name)
    return readings[first[bone] : first[bone + 1]]


def dense(stage):
    """Every taxel against every primitive that its bone can sense, with numpy formulas.

    The definition of `veca_marl.sim.touch.penetration`, with entries of rays found by bisection and
    nearest points by clipping.
    """
    ignored = unsensed_primitives(stage.scene.geoms, stage.body)
    readings = np.zeros(load_taxels().depths.shape)
    for bone in range(47):
        own = of_index(readings, bone)
        for g in np.flatnonzero(~ignored[bone]):
            np.maximum(own, _against(stage, bone, g), out=own)
    return readings


def of_index(readings, bone):
    first = load_taxels().first_triangle
    return readings[first[bone] : first[bone + 1]]


def _against(stage, bone, g):
    """Readings ``(t, 6)`` of one bone from one primitive alone."""
    geoms, taxels = stage.scene.geoms, load_taxels()
    own, other = taxels.thickness[bone], geoms.skins[g]
    length, inset = own + other, min(own, other)
    points, normals = taxel_positions(taxels, stage.scene.meshes.vertices[stage.body.vertices])
    normals = of_index(normals, bone)[:, None]
    depths = of_index(taxels.depths, bone)[..., None] + own + inset
    bases = of_index(points, bone) - depths * normals
    normals = np.broadcast_to(normals, bases.shape)
    radii = np.repeat(FIELD * of_index(taxels.gaps, bone)[:, None], 6, axis=1)
    if geoms.objects[g] == stage.body.id:
        radii[of_index(own_overlaps(FIELD).triangles, bone)] = 0.0
    thing = _pressing(geoms, g, inset)
    readings = np.zeros(bases.shape[:2])
    close = thing.distance(bases) < np.hypot(length, radii)
    if close.any():
        bones = _bones(stage, bone)
        readings[close] = _close(
            thing, bones, length, inset, bases[close], normals[close], radii[close]
        )
    return readings


def _bones(stage, bone):
    """The rigid primitives of a bone."""
    geoms = stage.scene.geoms
    rows = range(stage.body.geoms.start, stage.body.geoms.stop)
    frame = stage.body.rows.start + bone
    rows = [row for row in rows if geoms.frames[row] == frame and geoms.tangible[row]]
    return [_Solid(geoms, row, geoms.skins[row]) for row in rows]


def _close(thing, bones, length, inset, bases, normals, radii):
    """Readings ``(n,)`` of the taxels near a primitive."""

    def pressed(points):
        height = np.min([solid.distance(points) for solid in bones], axis=0) + inset
        return np.clip(1.0 - height / length, 0.0, 1.0)

    def field(bases):
        away = thing.distance(bases)
        nearest = np.where((away > 0.0)[..., None], thing.nearest(bases), bases)
        ahead = -np.sum(thing.outward(bases) * normals, axis=-1)
        along = np.clip(np.sum((nearest - bases) * normals, axis=-1), 0.0, length)
        beside = np.linalg.norm(nearest - bases - along[..., None] * normals, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = np.where(beside < radii, (1.0 - (beside / radii) ** 2) ** 2, 0.0)
        weight[away <= 0.0] = 1.0
        share = pressed(nearest)
        return weight * share * (1.0 - (1.0 - share) * (1.0 - np.clip(ahead, 0.0, 1.0) ** 2))

    entry = thing.entry(bases, normals, length)
    enters = bases + entry[..., None] * normals
    tilt = np.clip(-np.sum(thing.outward(enters) * normals, axis=-1), 0.0, 1.0)
    column = np.minimum((1.0 - entry / length) * tilt**2, pressed(enters))
    readings = np.maximum(np.where(entry < length, column, 0.0), field(bases))
    heights = np.stack([solid.distance(bases) for solid in bones])
    outward = np.stack([solid.outward(bases) for solid in bones])
    first = heights.argmin(axis=0)
    up = np.take_along_axis(outward, first[None, :, None], 0)[0]
    moved = bases + (-inset - heights.min(axis=0))[..., None] * up
    onto_bone = np.where(thing.distance(moved) <= 0.0, 1.0, field(moved))
    return np.where(thing.distance(bases) <= 0.0, np.maximum(readings, onto_bone), readings)


def _pressing(geoms, g, inset):
    """The primitive with a layer of its skin, round at the edges of what is below it."""
    if geoms.shapes[g] in (Shape.BOX, Shape.CYLINDER):
        return _Solid(geoms, g, geoms.skins[g], layer=inset)
    return _Solid(geoms, g, geoms.skins[g] - inset)


class _Solid:
    """A primitive of the scene with its outer layer taken off, and another one put on."""

    def __init__(self, geoms, g, off, layer=0.0):
        self._layer = layer
        self._position, self._rotation = geoms.positions[g], geoms.rotations[g]
        self._shape, size = Shape(geoms.shapes[g]), geoms.sizes[g].astype(float)
        if self._shape is Shape.BOX:
            self._size = size - off
        else:
            cut = 2.0 * off if self._shape is Shape.CYLINDER else 0.0
            self._size = np.array([size[0] - off, size[1] - cut])

    def distance(self, points):
        return _DISTANCES[self._shape](self._local(points), self._size)[0] - self._layer

    def outward(self, points):
        """Direction from the nearest surface."""
        return _DISTANCES[self._shape](self._local(points), self._size)[1] @ self._rotation.T

    def nearest(self, points):
        """The nearest point of the solid."""
        return points - self.distance(points)[..., None] * self.outward(points)

    def entry(self, points, directions, length):
        """Where rays enter, 0 for those that start inside and `length` for those that miss.

        The distance along a ray is convex: its minimum by ternary search, the entry by bisection.
        """
        low, high = np.zeros(points.shape[:-1]), np.full(points.shape[:-1], float(length))

        def along(way):
            return self.distance(points + way[..., None] * directions)

        for _ in range(45):
            third = (high - low) / 3
            nearer = along(low + third) < along(high - third)
            low, high = np.where(nearer, low, low + third), np.where(nearer, high - third, high)
        inner, outer = (low + high) / 2, np.zeros_like(low)
        misses = along(inner) > 0.0
        for _ in range(40):
            middle = (inner + outer) / 2
            inside = along(middle) <= 0.0
            inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
        return np.where(misses, length, np.where(along(np.zeros_like(low)) <= 0.0, 0.0, inner))

    def _local(self, points):
        return (points - self._position) @ self._rotation


def _round(vectors, radius):
    length = np.linalg.norm(vectors, axis=-1)
    return length - radius, vectors / np.maximum(length, 1e-12)[..., None]


def _ball(points, size):
    return _round(points, size[0])


def _capsule(points, size):
    axis = np.clip(points[..., 2], -size[1] / 2, size[1] / 2)
    return _round(points - axis[..., None] * np.array([0, 0, 1]), size[0])


def _convex(points, nearest, beyond, directions):
    """Outside by the nearest point, inside by the nearest face: depths ``(..., n)`` below each."""
    face = beyond.argmax(-1)
    inward = np.take_along_axis(directions, face[..., None, None], -2)[..., 0, :]
    inside = beyond.max(-1) <= 0.0
    away, outward = _round(points - nearest, 0.0)
    return np.where(inside, beyond.max(-1), away), np.where(inside[..., None], inward, outward)


def _box(points, size):
    directions = np.sign(points)[..., None] * np.eye(3)
    return _convex(points, np.clip(points, -size, size), np.abs(points) - size, directions)


def _cylinder(points, size):
    across = np.linalg.norm(points[..., :2], axis=-1)
    side = points * (1, 1, 0) / np.maximum(across, 1e-12)[..., None]
    end = np.sign(points) * (0, 0, 1)
    nearest = np.minimum(across, size[0])[..., None] * side
    nearest[..., 2] = np.clip(points[..., 2], -size[1] / 2, size[1] / 2)
    beyond = np.stack([np.abs(points[..., 2]) - size[1] / 2, across - size[0]], -1)
    return _convex(points, nearest, beyond, np.stack([end, side], -2))


_DISTANCES = {
    Shape.SPHERE: _ball,
    Shape.BOX: _box,
    Shape.CYLINDER: _cylinder,
    Shape.CAPSULE: _capsule,
}

"""A scene with a body and primitives in contact with it, and a dense reference for the taxels."""

from dataclasses import dataclass

import numpy as np
from skins import add_body, pose
from stand_in_worlds import SceneWorld

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.touch import TouchCfg, TouchSense, load_taxels, taxel_positions

# arms away from the trunk: nothing of the body touches the body
SPREAD = np.zeros(82)
for _side in "lr":
    SPREAD[load_skeleton().joint(f"{_side}_upper_arm", "abduction")] = 0.8


@dataclass
class Named:
    """The attributes of a body that `TouchSense` uses."""

    name: str
    object_id: int


class Stage:
    """A body in a scene of its own."""

    def __init__(self, angles=SPREAD, cfg=None, position=(0.0, 0.0, 0.0), rotation=None):
        self.scene = Scene()
        self.body = add_body(self.scene)
        pose(self.body, angles, position, rotation)
        self.sense = TouchSense(
            cfg or TouchCfg(), Named("body", self.body.id), SceneWorld(self.scene)
        )

    def add(self, shape, size, position, rotation=None):
        geom = Geom(Shape[shape], size)
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
    """Every taxel against every primitive that its bone can sense, with numpy formulas."""
    taxels, scene = load_taxels(), stage.scene
    vertices = scene.meshes.vertices[stage.body.vertices]
    points, normals = taxel_positions(taxels, vertices)
    points = points - taxels.depths[..., None] * normals[:, None]
    bones = np.repeat(np.arange(47), np.diff(taxels.first_triangle))
    ignored = stage.sense._ignored_pairs()[bones]
    readings = np.zeros(points.shape[:2])
    geoms = scene.geoms
    for g, shape in enumerate(geoms.shapes):
        local = (points - geoms.positions[g]) @ geoms.rotations[g]
        depth, outward = _DISTANCES[Shape(shape)](local, geoms.sizes[g].astype(float))
        against = -np.einsum("tki,ti->tk", outward, normals @ geoms.rotations[g])
        share = np.clip(-depth / (taxels.thickness[bones] + geoms.skins[g])[:, None], 0.0, 1.0)
        felt = share * np.clip(against, 0.0, 1.0)
        readings = np.maximum(readings, np.where(ignored[:, g, None], 0.0, felt))
    return readings


def _round(vectors, radius):
    length = np.linalg.norm(vectors, axis=-1)
    return length - radius, vectors / np.maximum(length, 1e-12)[..., None]


def _ball(points, size):
    return _round(points, size[0])


def _capsule(points, size):
    axis = np.clip(points[..., 2], -size[1] / 2, size[1] / 2)
    return _round(points - axis[..., None] * np.array([0, 0, 1]), size[0])


def _nearest_face(beyond, directions):
    """Within a convex thing the nearest face, given the depth ``(..., n)`` below each."""
    face = beyond.argmax(-1)
    outward = np.take_along_axis(directions, face[..., None, None], -2)[..., 0, :]
    return beyond.max(-1), outward


def _box(points, size):
    directions = np.sign(points)[..., None] * np.eye(3)
    return _nearest_face(np.abs(points) - size, directions)


def _cylinder(points, size):
    across = np.linalg.norm(points[..., :2], axis=-1)
    side = points * (1, 1, 0) / np.maximum(across, 1e-12)[..., None]
    end = np.sign(points) * (0, 0, 1)
    beyond = np.stack([np.abs(points[..., 2]) - size[1] / 2, across - size[0]], -1)
    return _nearest_face(beyond, np.stack([end, side], -2))


_DISTANCES = {
    Shape.SPHERE: _ball,
    Shape.BOX: _box,
    Shape.CYLINDER: _cylinder,
    Shape.CAPSULE: _capsule,
}

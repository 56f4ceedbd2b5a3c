"""A body with arms away from the trunk, and points that are pressed into its skin.

Two-point resolution: two balls of 3 mm press into the skin. They are resolved if the readings have
a maximum at each ball and fall below half of the smaller maximum between them, in the middle third
of the line, where at least one taxel must lie. The threshold of a bone is the smallest distance at
which three quarters of random pairs are resolved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from veca_marl.sim.body import Body
from veca_marl.sim.body.anatomy import REFERENCE, Growth, forward_kinematics, load_skeleton
from veca_marl.sim.body.appearance import SHIRTS, bone_geoms, dressed_skin
from veca_marl.sim.geometry import (
    Bools,
    Floats,
    Geom,
    Scene,
    Shape,
    distance_and_gradient,
    rotation_with_z,
)
from veca_marl.sim.physics import World
from veca_marl.sim.touch import TouchCfg, TouchSense, load_taxels, taxel_positions

_ABDUCTION_RAD = 0.8
_CLEARANCE_M = 0.002  # of points from the skin of other bones
_FARTHEST_M = 0.012  # of the physical skin from the mesh
_STEPS = 8
_TRIALS = 1000


@dataclass
class _Named:
    """What `TouchSense` needs to know of a body."""

    name: str
    object_id: int
    growth: Growth = REFERENCE


@dataclass
class _SceneAlone:
    """What `TouchSense` needs to know of a world."""

    scene: Scene

    @property
    def version(self) -> int:
        """Changes with every update of the scene."""
        return self.scene.version


class BareBody:
    """The skin of a body that primitives touch.

    Args:
        cfg: Settings of touch.
        shape: Shape of the primitives.
        size: Their size, metres.
        skin_m: Thickness of their own skin.
        count: Their number.
    """

    def __init__(
        self,
        cfg: TouchCfg,
        shape: Shape,
        size: tuple[float, ...],
        skin_m: float = 0.0,
        count: int = 1,
    ) -> None:
        skeleton = load_skeleton()
        self._scene = Scene()
        body = self._scene.add_object(
            "body", bone_geoms(skeleton, SHIRTS[0]), dressed_skin(skeleton, SHIRTS[0])
        )
        angles = np.zeros(len(skeleton.joints))
        for side in "lr":
            angles[skeleton.joint(f"{side}_upper_arm", "abduction")] = _ABDUCTION_RAD
        things = [[Geom(shape, size, skin_m=skin_m)] for _ in range(count)]
        self._things = self._scene.add_object("things", things)
        forward_kinematics(skeleton, angles, body.positions, body.rotations)
        self._body = body
        self._sense = TouchSense(
            cfg,
            cast("Body", _Named("body", body.id)),
            cast("World", _SceneAlone(self._scene)),
        )
        self._scene.update()
        self._corners = self._scene.meshes.vertices[body.vertices][load_taxels().triangles].copy()

    def read(self, *places: tuple[Floats, Floats]) -> Floats:
        """Return the readings ``(1648, 6)`` with the primitives at places.

        Args:
            *places: For each primitive the centre ``(3,)``, metres, and the direction ``(3,)`` of
                its z axis.
        """
        for thing, (centre, axis) in enumerate(places):
            self._things.positions[thing] = centre
            self._things.rotations[thing] = rotation_with_z(axis)
        self._scene.update()
        return self._sense.update_taxels()

    def taxels(self) -> Floats:
        """Return the places of the taxels on the mesh, ``(1648, 6, 3)`` metres."""
        vertices = self._scene.meshes.vertices[self._body.vertices]
        return taxel_positions(load_taxels(), vertices)[0]

    def random_point(self, bone: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Return a random point of the skin of a bone that no other bone covers, evenly by area.

        Args:
            bone: Index of the bone.
            rng: Chooses.

        Returns:
            The point ``(3,)``, metres, and the outward normal there.
        """
        first = load_taxels().first_triangle
        corners = self._corners[first[bone] : first[bone + 1]]
        edges = corners[:, 1:] - corners[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        for _ in range(_TRIALS):
            triangle = int(rng.choice(len(area), p=area / area.sum()))
            on_mesh = rng.dirichlet((1.0, 1.0, 1.0)) @ corners[triangle]
            place, normal = self.onto_skin(bone, on_mesh)
            if np.linalg.norm(place - on_mesh) < _FARTHEST_M and not self._covered(bone, place):
                return place, normal
        raise RuntimeError(f"bone {bone}: no free skin found in {_TRIALS} trials")

    def onto_skin(self, bone: int, place: Floats) -> tuple[Floats, Floats]:
        """Move a point along the gradient of the distance from a bone to its skin.

        Args:
            bone: Index of the bone.
            place: ``(3,)`` metres.

        Returns:
            The point on the skin and the outward normal there.
        """
        normal = np.zeros(3)
        for _ in range(_STEPS):
            height, normal = self._height(bone, place)
            place = place - (height - load_skeleton().bones[bone].skin_thickness_m) * normal
        return place, normal

    def _covered(self, bone: int, place: Floats) -> bool:
        """Return whether a point lies in or close to the skin of another bone."""
        return any(
            self._height(index, place)[0] < other.skin_thickness_m + _CLEARANCE_M
            for index, other in enumerate(load_skeleton().bones)
            if index != bone
        )

    def _height(self, bone: int, place: Floats) -> tuple[float, Floats]:
        """Return the distance from a rigid bone and its gradient, world frame."""
        turn, origin = self._body.rotations[bone], self._body.positions[bone]
        found = []
        for part in load_skeleton().bones[bone].colliders:
            centre, rotation = part.pose
            axes = turn @ rotation
            x, y, z = axes.T @ (place - origin - turn @ centre)
            size = (*part.size, 0.0, 0.0)
            away = distance_and_gradient(int(part.shape), (size[0], size[1], size[2]), x, y, z)
            found.append((away[0], axes @ np.array(away[1:])))
        nearest: tuple[float, Floats] = min(found, key=lambda entry: entry[0])
        return nearest


# the distal bone of an index finger with its skin, pressed end on
FINGERTIP = (Shape.CAPSULE, (0.0044, 0.004))
FINGERTIP_SKIN_M = 0.0015
NOTICED = 0.02
"""Readings above this count as sensed."""
BONES = tuple(bone.name for bone in load_skeleton().bones if not bone.name.startswith("r_"))
"""Bones that are poked; the right side mirrors the left."""


@dataclass(frozen=True)
class Noticed:
    """How many pokes were sensed.

    Attributes:
        share: Share of the pokes with a reading above `NOTICED`.
        strength: Mean of the largest reading of each poke.
    """

    share: float
    strength: float


def noticed_pokes(
    bone: str, depth: float, count: int, receptive_field: float, rng: np.random.Generator
) -> Noticed:
    """Poke random points of the skin of a bone with a fingertip, along the normal of the skin.

    Points are distributed by area and lie on skin that no other bone covers.

    Args:
        bone: Its name.
        depth: Penetration as a share of the thickness of both skins.
        count: Number of pokes.
        receptive_field: See `TouchCfg`.
        rng: Chooses the points.
    """
    body = BareBody(TouchCfg(receptive_field=receptive_field), *FINGERTIP, FINGERTIP_SKIN_M)
    index = load_skeleton().bone(bone)
    skin_m = load_skeleton().bones[index].skin_thickness_m + FINGERTIP_SKIN_M
    length_m = FINGERTIP[1][0] + FINGERTIP[1][1] / 2
    largest = []
    for _ in range(count):
        place, normal = body.random_point(index, rng)
        readings = body.read((place + (length_m - depth * skin_m) * normal, normal))
        largest.append(readings.max())
    values = np.array(largest)
    return Noticed(float((values > NOTICED).mean()), float(values.mean()))


RADIUS_M = 0.0015
DISTANCES_M = (0.003, 0.004, 0.006, 0.009, 0.013, 0.018, 0.025, 0.035, 0.045, 0.06, 0.08)
_DEPTH = 0.5
_RESOLVED = 0.75
_VALLEY = 0.5


def threshold_m(bone: str, count: int, rng: np.random.Generator) -> float:
    """Return the two-point threshold of a bone, metres; infinite if none of `DISTANCES_M`.

    Args:
        bone: Its name.
        count: Number of pairs for each distance.
        rng: Chooses the pairs.
    """
    body = BareBody(TouchCfg(), Shape.SPHERE, (RADIUS_M,), count=2)
    index = load_skeleton().bone(bone)
    for distance_m in DISTANCES_M:
        if resolved_share(body, index, distance_m, count, rng) >= _RESOLVED:
            return distance_m
    return float("inf")


def resolved_share(
    body: BareBody, bone: int, distance_m: float, count: int, rng: np.random.Generator
) -> float:
    """Return the share of random pairs of points at a distance that are resolved."""
    pairs = [_random_pair(body, bone, distance_m, rng) for _ in range(count)]
    return float(np.mean([_resolved(body, bone, pair) for pair in pairs]))


def _random_pair(
    body: BareBody, bone: int, distance_m: float, rng: np.random.Generator
) -> list[tuple[Floats, Floats]]:
    """Return two points of the skin of a bone with their normals."""
    place, normal = body.random_point(bone, rng)
    along = np.cross(normal, rng.normal(size=3))
    along *= 0.5 * distance_m / np.linalg.norm(along)
    return [body.onto_skin(bone, place + way * along) for way in (-1.0, 1.0)]


def _resolved(body: BareBody, bone: int, pair: Sequence[tuple[Floats, Floats]]) -> bool:
    """Return whether the readings of two points have two maxima and a gap between them."""
    depth_m = _DEPTH * load_skeleton().bones[bone].skin_thickness_m
    readings = body.read(*[(at + (RADIUS_M - depth_m) * out, out) for at, out in pair]).ravel()
    (first, _), (second, _) = pair
    line = second - first
    along = ((body.taxels().reshape(-1, 3) - first) @ line) / (line @ line)
    between = readings[(along > 1 / 3) & (along < 2 / 3) & _near(body, first, second)]
    peaks = min(readings[along < 1 / 3].max(), readings[along > 2 / 3].max())
    return bool(peaks > NOTICED and len(between) > 0 and between.max() < _VALLEY * peaks)


def _near(body: BareBody, first: Floats, second: Floats) -> Bools:
    """Return which taxels lie within the distance of two points from their middle."""
    away = np.linalg.norm(body.taxels().reshape(-1, 3) - (first + second) / 2, axis=1)
    near: Bools = away < np.linalg.norm(second - first)
    return near

"""A body with arms away from the trunk in an otherwise empty scene, and things that touch it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from veca_marl.sim.body import Body
from veca_marl.sim.body.anatomy import forward_kinematics, load_skeleton
from veca_marl.sim.body.appearance import SHIRTS, bone_geoms, dressed_skin
from veca_marl.sim.geometry import (
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

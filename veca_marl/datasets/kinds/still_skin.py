"""The skin of a body that holds a pose, and one thing that presses on it.

Nothing moves by itself: the caller puts the bones and the thing where they are.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import binding_pose, forward_kinematics, load_skeleton
from veca_marl.sim.body.appearance import SHIRTS, bone_geoms, dressed_skin
from veca_marl.sim.body.humanoid.postures import Posture, pelvis_rotation, posture_angles
from veca_marl.sim.geometry import Bools, Floats, Geom, Pose, Scene, Shape
from veca_marl.sim.touch import TouchCfg
from veca_marl.sim.touch.parts import PartReadings, skin_parts
from veca_marl.sim.touch.penetration import empty_workspace, read_taxels
from veca_marl.sim.touch.quality import make_transform
from veca_marl.sim.touch.rigid_bones import rigid_bones
from veca_marl.sim.touch.taxels import (
    TAXELS_PER_TRIANGLE,
    Fields,
    fields_of,
    load_taxels,
    taxel_positions,
)
from veca_marl.sim.touch.touch_sense import own_overlaps, unsensed_primitives

Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class BonePoses:
    """Poses of all bones.

    Attributes:
        positions: ``(47, 3)`` metres, world frame.
        rotations: ``(47, 3, 3)`` to the world.
    """

    positions: Floats
    rotations: Floats

    @classmethod
    def of(cls, pelvis: Pose, angles: Floats) -> BonePoses:
        """Return the poses for joint angles ``(82,)``, rad, by forward kinematics."""
        skeleton = load_skeleton()
        bones = len(skeleton.bones)
        positions, rotations = np.zeros((bones, 3)), np.zeros((bones, 3, 3))
        positions[0], rotations[0] = pelvis
        forward_kinematics(skeleton, angles, positions, rotations)
        return cls(positions, rotations)

    @classmethod
    def of_posture(cls, posture: Posture) -> BonePoses:
        """Return the poses of a posture with the pelvis at the origin."""
        angles = posture_angles(load_skeleton(), posture)
        return cls.of(Pose(np.zeros(3), pelvis_rotation(posture, 0.0)), angles)

    def bone(self, name: str) -> Pose:
        """Return the pose of a bone."""
        index = load_skeleton().bone(name)
        return Pose(self.positions[index], self.rotations[index])

    def turned(self, rotation: Floats, about: Floats) -> BonePoses:
        """Return the poses after a rotation ``(3, 3)`` of the whole body about a point ``(3,)``."""
        return BonePoses(about + (self.positions - about) @ rotation.T, rotation @ self.rotations)


@functools.cache
def _body_scene() -> tuple[Scene, Bools]:
    """Return a scene with only a body, and the pairs ``(47, G)`` of it that are not sensed."""
    skeleton, scene, shirt = load_skeleton(), Scene(), SHIRTS[0]
    body = scene.add_object("body", bone_geoms(skeleton, shirt), dressed_skin(skeleton, shirt))
    return scene, unsensed_primitives(scene.geoms, body)


class StillSkin:
    """A skin in a scene with one thing.

    Args:
        cfg: Settings of touch; only the receptive field matters here.
        poses: Poses of the bones.
        thing: Primitives of the thing on its own frame.
        bones: Names of the bones whose skin is read; None is all of them.
    """

    def __init__(
        self,
        cfg: TouchCfg,
        poses: BonePoses,
        thing: Sequence[Geom],
        bones: Sequence[str] | None = None,
    ) -> None:
        self._taxels = load_taxels()
        empty, unsensed = _body_scene()
        self._scene = copy.deepcopy(empty)
        self._body = self._scene.objects[0]
        self._thing = self._scene.add_object("thing", [thing])
        self._body.positions[:], self._body.rotations[:] = poses.positions, poses.rotations
        overlaps = own_overlaps(cfg.receptive_field)
        self._fields: Fields = fields_of(self._taxels, cfg.receptive_field, self._body, overlaps)
        names = [bone.name for bone in load_skeleton().bones]
        self._own = rigid_bones(self._scene.geoms, self._body, len(names))
        self._ignored: Bools = np.pad(unsensed, ((0, 0), (0, len(thing))))
        if bones is not None:
            self._ignored[[name not in bones for name in names]] = True
        vertices, count = self._body.vertices, len(self._scene.geoms.shapes)
        self._workspace = empty_workspace(self._taxels, vertices.stop - vertices.start, count)
        self._readings = np.zeros((len(self._taxels.triangles), TAXELS_PER_TRIANGLE))
        self._scene.update()

    def taxels(self) -> tuple[Floats, Floats]:
        """Return positions ``(T, 6, 3)`` of the taxels and normals ``(T, 3)`` of the triangles."""
        return taxel_positions(self._taxels, self._vertices())

    def _vertices(self) -> Floats:
        vertices: Floats = self._scene.meshes.vertices[self._body.vertices]
        return vertices

    def press(self, thing: Pose) -> Floats:
        """Put the thing at a pose; return the readings ``(1648, 6)``, a buffer.

        The next call overwrites it.
        """
        self._thing.positions[0], self._thing.rotations[0] = thing
        self._scene.update()
        read_taxels(
            self._taxels,
            self._fields,
            self._vertices(),
            self._scene.geoms,
            self._own,
            self._ignored,
            self._workspace,
            self._readings,
        )
        return self._readings


class SkinObservation:
    """What the settings of touch leave of readings, of all triangles or of some.

    Args:
        cfg: Settings of touch.
        triangles: ``(t,)`` indices of the triangles that are observed; None is all of them.
    """

    def __init__(self, cfg: TouchCfg, triangles: NDArray[np.int64] | None = None) -> None:
        self._transform = make_transform(cfg.quality, cfg.binary_above)
        every = len(load_taxels().triangles)
        self._triangles = np.arange(every) if triangles is None else triangles
        self._parts = PartReadings() if cfg.parts else None
        own = set(self._triangles.tolist())
        parts = [
            i for i, part in enumerate(skin_parts()) if own.issuperset(part.triangles.tolist())
        ]
        count = len(skin_parts())
        self._part_columns = np.array([*parts, *(count + i for i in parts)], np.int64)
        names = [skin_parts()[i].name for i in parts]
        self.part_names = (*(f"{n} mean" for n in names), *(f"{n} maximum" for n in names))
        self.sizes: dict[str, int] = {}
        if cfg.taxels:
            self.sizes["touch"] = len(self._triangles) * TAXELS_PER_TRIANGLE
        if cfg.parts:
            self.sizes["touch_parts"] = len(self._part_columns)

    def __call__(self, readings: Floats) -> dict[str, Bytes]:
        """Return the bytes of each observation, from readings ``(1648, 6)`` in [0, 1]."""
        transformed = self._transform(readings)
        observed: dict[str, Bytes] = {}
        if "touch" in self.sizes:
            observed["touch"] = as_bytes(transformed[self._triangles].ravel())
        if self._parts is not None:
            observed["touch_parts"] = as_bytes(self._parts(transformed)[self._part_columns])
        return observed


def as_bytes(readings: Floats) -> Bytes:
    """Return readings in [0, 1] in steps of 1/255; what is not 0 is at least 1."""
    return np.ceil(readings * 255.0 - 1e-9).astype(np.uint8)


def binding_taxels() -> Floats:
    """Return the positions ``(T, 6, 3)`` of the taxels in the binding pose, metres."""
    sphere = [Geom(Shape.SPHERE, (0.01,))]
    skin = StillSkin(TouchCfg(), BonePoses(*binding_pose(load_skeleton())), sphere)
    return skin.taxels()[0]

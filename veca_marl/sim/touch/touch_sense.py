"""The sense of touch: the readings of 9888 taxels on the skin of a body, or of its parts.

The primitives of bones overlap inside the body, and the mesh continues inside its joints. With a
receptive field some taxels there would sense their own body in every pose, and so these are points
to it. The hands of the youngest are broad for their length: there the base of the thumb lies in the
skin of the palm, and the taxels at that place do not sense that bone at all.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.body.anatomy import REFERENCE, Growth, Skeleton, binding_pose, load_skeleton
from veca_marl.sim.body.appearance import SKIN, bone_geoms, dressed_skin
from veca_marl.sim.body.humanoid.articulation import may_collide
from veca_marl.sim.geometry import Bools, Floats, GeomTable, Scene, SceneObject
from veca_marl.sim.physics import World
from veca_marl.sim.sense import ArraySpec, Sense
from veca_marl.sim.touch.parts import PartReadings
from veca_marl.sim.touch.penetration import empty_workspace, read_taxels
from veca_marl.sim.touch.quality import TouchQuality, make_transform
from veca_marl.sim.touch.rigid_bones import rigid_bones
from veca_marl.sim.touch.taxels import (
    TAXELS_PER_TRIANGLE,
    Overlaps,
    fields_of,
    load_taxels,
    taxel_positions,
)

LINE_M = 0.05
"""Length of the debug line of a taxel that reads 1; the value is ours."""


def unsensed_bones(skeleton: Skeleton) -> Bools:
    """Return the ``(47, 47)`` symmetric mask of pairs of bones that are not sensed.

    These are a bone with itself, its parent, its children and the other children of its parent,
    which joints keep in contact, unless the two collide in the physics, as thighs and upper arms
    do.
    """
    parents = skeleton.parents
    near = np.eye(len(parents), dtype=np.bool_) | (parents[:, None] == parents[None, :])
    child_of: Bools = parents[:, None] == np.arange(len(parents))[None, :]
    names = [bone.name for bone in skeleton.bones]
    collide = np.array([[may_collide(a, b) for b in names] for a in names])
    unsensed: Bools = (near | child_of | child_of.T) & ~collide
    return unsensed


def unsensed_primitives(geoms: GeomTable, body: SceneObject) -> Bools:
    """Return the mask ``(47, G)`` of intangible primitives and of unsensed bones of the body."""
    skeleton = load_skeleton()
    ignored = np.repeat(~geoms.tangible[None], len(skeleton.bones), axis=0)
    own = np.flatnonzero(geoms.objects == body.id)
    ignored[:, own] |= unsensed_bones(skeleton)[:, geoms.frames[own] - body.rows.start]
    return ignored


def own_overlaps(share: float, growth: Growth = REFERENCE) -> Overlaps:
    """Return what reads its own body in the binding pose.

    In that pose arms and legs are spread, and no part of the body is in contact with another.

    Args:
        share: Radius of the receptive fields as a share of `TaxelTable.gaps`.
        growth: Size of the body.
    """
    return _own_overlaps(share, growth)


@functools.cache
def _own_overlaps(share: float, growth: Growth) -> Overlaps:
    skeleton, scene = load_skeleton(growth), Scene()
    body = scene.add_object("body", bone_geoms(skeleton, SKIN), dressed_skin(skeleton, SKIN))
    body.positions[:], body.rotations[:] = binding_pose(skeleton)
    scene.update()
    unsensed = unsensed_primitives(scene.geoms, body)
    triangles = _reading_triangles(share, growth, scene, unsensed)
    joined: Bools = np.zeros((len(skeleton.bones), len(triangles)), np.bool_)
    # a point reads nothing where a field does not; of most bodies no point reads anything
    if triangles.any() and _reading_triangles(0.0, growth, scene, unsensed).any():
        for bone in range(len(joined)):
            others: Bools = scene.geoms.frames != body.rows.start + bone
            joined[bone] = _reading_triangles(0.0, growth, scene, unsensed | others)
    return Overlaps(triangles, joined)


def _reading_triangles(share: float, growth: Growth, scene: Scene, ignored: Bools) -> Bools:
    """Return the mask ``(T,)`` of the triangles of a body, alone in a scene, that read anything."""
    taxels, vertices, body = load_taxels(growth), scene.meshes.vertices, scene.objects[0]
    readings = np.zeros(taxels.depths.shape)
    read_taxels(
        taxels,
        fields_of(taxels, share, body),
        vertices,
        scene.geoms,
        rigid_bones(scene.geoms, body, len(taxels.thickness)),
        ignored,
        empty_workspace(taxels, len(vertices), len(scene.geoms.shapes)),
        readings,
    )
    pressed: Bools = readings.max(axis=1) > 0.0
    return pressed


@dataclass
class TouchCfg:
    """Settings of the sense of touch.

    Attributes:
        present: Whether the observation contains the sense.
        quality: See `TouchQuality`.
        taxels: Whether the observation contains `touch`, the readings of all taxels.
        parts: Whether the observation contains `touch_parts`, mean and maximum of each named part
            of the skin, computed from the readings that the quality leaves.
        binary_above: With `binary`, the reading above which a taxel reads 1, in [0, 1).
        receptive_field: Radius of the receptive field of a taxel, in [0, 2], relative to the
            greatest distance of a corner of its triangle from the nearest taxel. 0.6 is 9 to 12 mm
            on trunk and thighs, 8 mm on the head, 3 mm on palms and 1.5 mm on finger tips. With 0
            taxels are points, and objects that are smaller than the distance of the taxels are not
            sensed in most places.
    """

    present: bool = True
    quality: TouchQuality = TouchQuality.skin
    taxels: bool = True
    parts: bool = False
    binary_above: float = 0.0
    receptive_field: float = 0.6

    def __post_init__(self) -> None:
        if not isinstance(self.quality, TouchQuality):
            choices = [quality.name for quality in TouchQuality]
            raise ValueError(f"senses.touch.quality={self.quality!r}; choices: {choices}")
        if self.present and not (self.taxels or self.parts):
            raise ValueError(
                "senses.touch.taxels=false and senses.touch.parts=false: one must be true; "
                "senses.touch.present=false leaves touch out"
            )
        if not 0.0 <= self.binary_above < 1.0:
            raise ValueError(f"senses.touch.binary_above={self.binary_above} must be in [0, 1)")
        if not 0.0 <= self.receptive_field <= 2.0:
            raise ValueError(
                f"senses.touch.receptive_field={self.receptive_field} must be in [0, 2]"
            )


class TouchSense(Sense):
    """The skin of one body. It has no memory: steps that were not read change nothing.

    Observations:
        touch: ``(9888,)`` float32 in [0, 1], sorted by bone, six taxels per triangle; see
            `veca_marl.sim.touch.penetration` for the definition of a reading and `taxels_of` for
            the taxels of a bone. Exactly 0 without contact.
        touch_parts: ``(118,)`` float32 in [0, 1], if requested: the means of the 59 parts of
            `veca_marl.sim.touch.parts.skin_parts`, then their maxima.
    """

    cfg_type = TouchCfg

    def __init__(self, cfg: TouchCfg, body: Body, world: World) -> None:
        """See `Sense`.

        Raises:
            ValueError: If the body has no skin with the triangles of the taxels.
        """
        super().__init__(world)
        self._scene = world.scene
        self._object = world.scene.objects[body.object_id]
        self._taxels = load_taxels(body.growth)
        self._transform = make_transform(cfg.quality, cfg.binary_above)
        bones, vertices = len(self._taxels.thickness), self._object.vertices
        self._ignored: Bools = np.zeros((bones, 0), np.bool_)
        overlaps = own_overlaps(cfg.receptive_field, body.growth)
        self._fields = fields_of(self._taxels, cfg.receptive_field, self._object, overlaps)
        self._own = rigid_bones(self._scene.geoms, self._object, bones)
        self._workspace = empty_workspace(self._taxels, vertices.stop - vertices.start, 0)
        self._readings = np.zeros((len(self._taxels.triangles), TAXELS_PER_TRIANGLE))
        self._parts = PartReadings() if cfg.parts else None
        self._with_taxels = cfg.taxels
        sizes = {"touch": self._readings.size} if cfg.taxels else {}
        if self._parts is not None:
            sizes["touch_parts"] = self._parts.size
        self.specs = {key: ArraySpec((size,), np.float32, 0.0, 1.0) for key, size in sizes.items()}
        if self._object.triangles.stop - self._object.triangles.start != len(self._readings):
            raise ValueError(f"{body.name} has no skin of {len(self._readings)} triangles")

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        readings = self._transform(self.update_taxels())
        observed: dict[str, NDArray[Any]] = {}
        if self._with_taxels:
            observed["touch"] = readings.ravel().astype(np.float32)
        if self._parts is not None:
            observed["touch_parts"] = self._parts(readings).astype(np.float32)
        return observed

    def update_taxels(self) -> Floats:
        """Return the present readings of all taxels (the paper's name), whatever the quality.

        Returns:
            ``(1648, 6)`` in [0, 1]: triangles sorted by bone, six taxels each. It is a buffer that
            the next call, also by `read`, overwrites.
        """
        geoms = self._scene.geoms
        if self._ignored.shape[1] != len(geoms.shapes):
            self._ignored = unsensed_primitives(geoms, self._object)
            self._workspace = self._workspace._replace(candidates=np.zeros_like(self._ignored))
        read_taxels(
            self._taxels,
            self._fields,
            self.skin_vertices(),
            geoms,
            self._own,
            self._ignored,
            self._workspace,
            self._readings,
        )
        return self._readings

    def skin_vertices(self) -> Floats:
        """Return the present vertices of the skin, ``(V, 3)`` metres in the world frame."""
        vertices: Floats = self._scene.meshes.vertices[self._object.vertices]
        return vertices


class Tactile(NamedTuple):
    """Readings of the taxels of a body.

    Attributes:
        readings: ``(9888,)`` in [0, 1], see `TouchSense`; 0 for disabled taxels.
        lines: ``(n, 2, 3)`` metres, world frame: the debug lines of the enabled taxels with a
            reading above 0, from the taxel along the direction in which it is pressed, with a
            length in proportion to the reading. Empty without `debug`.
    """

    readings: Floats
    lines: Floats


def get_tactile(sense: TouchSense, taxel_ratio: float = 1.0, debug: bool = False) -> Tactile:
    """Return the present readings of the taxels of a body, whatever the quality of its touch.

    The paper draws a blue line for each taxel, and disables a share of the taxels so that the
    lines do not hide the body; `veca_marl.envs.rendering.draw_tactile_lines` draws these.

    Args:
        sense: The sense of touch of the body.
        taxel_ratio: Share of the taxels that are enabled, in [0, 1], evenly spaced in their order.
        debug: Whether to compute the lines.

    Raises:
        ValueError: If the ratio is not in [0, 1].
    """
    if not 0.0 <= taxel_ratio <= 1.0:
        raise ValueError(f"taxel_ratio={taxel_ratio} must be in [0, 1]")
    readings = sense.update_taxels().ravel().copy()
    readings[~_enabled(readings.size, taxel_ratio)] = 0.0
    return Tactile(readings, _lines(sense, readings) if debug else np.zeros((0, 2, 3)))


def _enabled(count: int, ratio: float) -> Bools:
    """Return a mask ``(count,)`` of `ratio` of the elements, evenly spaced."""
    before: Floats = np.floor(np.arange(count + 1) * ratio + 1e-9)
    enabled: Bools = np.diff(before) > 0.0
    return enabled


def _lines(sense: TouchSense, readings: Floats) -> Floats:
    """Return the lines ``(n, 2, 3)`` of all taxels with a reading above 0."""
    taxels = load_taxels()
    positions, normals = taxel_positions(taxels, sense.skin_vertices())
    pressed = np.flatnonzero(readings)
    starts = positions.reshape(-1, 3)[pressed]
    inward = -normals[pressed // positions.shape[1]]
    return np.stack([starts, starts + LINE_M * readings[pressed, None] * inward], axis=1)

"""Touch: what 9888 taxels on the skin of a body feel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.body.anatomy.skeleton import Skeleton, load_skeleton
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.tables import Bools
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.spec import ArraySpec
from veca_marl.sim.touch.penetration import Workspace, feel, neighbours
from veca_marl.sim.touch.taxels import BARYCENTRIC, TAXELS_PER_TRIANGLE, load_taxels

Readings = NDArray[np.float64]
Grade = Callable[[Readings], Readings]


class TouchQuality(Enum):
    """How finely a body feels. It changes what is felt, never its shape.

    `skin` is every taxel, `hands` those of the hands with fingers alone, the others read 0;
    `binary` says whether a taxel is touched; `coarse` gives every taxel of a bone their mean.
    """

    skin = "skin"
    hands = "hands"
    binary = "binary"
    coarse = "coarse"


@dataclass
class TouchCfg:
    """Touch as data.

    Attributes:
        present: Whether the body feels at all.
        quality: See `TouchQuality`.
        binary_above: With `binary`, the reading above which a taxel counts as touched, in [0, 1).
    """

    present: bool = True
    quality: TouchQuality = TouchQuality.skin
    binary_above: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.quality, TouchQuality):
            raise ValueError(
                f"touch quality {self.quality!r}: want one of {[q.name for q in TouchQuality]}"
            )
        if not 0.0 <= self.binary_above < 1.0:
            raise ValueError(f"binary_above {self.binary_above}: want a reading in [0, 1)")


class TouchSense(Sense):
    """The skin of one body.

    Observations:
        touch: ``(9888,)`` float32 in [0, 1], sorted by bone, six taxels per triangle; see
            `veca_marl.sim.touch.penetration` for the definition of a reading and `taxels_of` for
            the taxels of a bone. Exactly 0 without contact.
    """

    cfg_type = TouchCfg

    def __init__(self, cfg: TouchCfg, body: Body, world: World) -> None:
        super().__init__(world)
        self._scene = world.scene
        self._object = world.scene.objects[body.object_id]
        self._taxels = load_taxels()
        self._grade = _grade(cfg, load_skeleton())
        bones = len(self._taxels.thickness)
        self._deaf: Bools = np.zeros((bones, 0), np.bool_)
        self._workspace = Workspace(
            patches=np.zeros((len(self._taxels.patches) - 1, 4)),
            bones=np.zeros((bones + 1, 4)),
            near=np.zeros_like(self._deaf),
            local=np.zeros((self._object.vertices.stop - self._object.vertices.start, 3)),
        )
        self._readings = np.zeros((len(self._taxels.triangles), TAXELS_PER_TRIANGLE))
        self.specs = {"touch": ArraySpec((self._readings.size,), np.float32, 0.0, 1.0)}
        if self._object.triangles.stop - self._object.triangles.start != len(self._readings):
            raise ValueError(f"{body.name} has no skin of {len(self._readings)} triangles to feel")

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        return {"touch": self._grade(self.update_taxels()).ravel().astype(np.float32)}

    def update_taxels(self) -> Floats:
        """Return what all taxels read now (the paper's name), whatever the quality.

        Returns:
            ``(1648, 6)`` in [0, 1]: triangles sorted by bone, the six taxels of each. A buffer:
            the next call overwrites it.
        """
        geoms = self._scene.geoms
        if self._deaf.shape[1] != len(geoms.shapes):
            self._deaf = self._ignored_pairs()
            self._workspace = self._workspace._replace(near=np.zeros_like(self._deaf))
        vertices = self._scene.meshes.vertices[self._object.vertices]
        feel(
            self._taxels,
            vertices,
            geoms,
            self._deaf,
            BARYCENTRIC,
            self._workspace,
            self._readings,
        )
        return self._readings

    def _ignored_pairs(self) -> Bools:
        """Mask ``(bones, G)``: intangible things, and own bones that joints keep together."""
        geoms, rows = self._scene.geoms, self._object.rows
        deaf = np.repeat(~geoms.tangible[None], len(self._taxels.thickness), axis=0)
        own = np.flatnonzero(geoms.objects == self._object.id)
        deaf[:, own] |= neighbours(load_skeleton())[:, geoms.frames[own] - rows.start]
        return deaf


def _grade(cfg: TouchCfg, skeleton: Skeleton) -> Grade:
    """Return what turns fine readings ``(1648, 6)`` into those of a quality."""
    match cfg.quality:
        case TouchQuality.skin:
            return _as_felt
        case TouchQuality.hands:
            return Masked(_of_hands(skeleton))
        case TouchQuality.binary:
            return Thresholded(cfg.binary_above)
        case TouchQuality.coarse:
            return Averaged(load_taxels().first_triangle[:-1])


def _as_felt(readings: Readings) -> Readings:
    return readings


class Masked:
    """Lets only some triangles feel.

    Args:
        feeling: ``(1648,)`` which.
    """

    def __init__(self, feeling: Bools) -> None:
        self._feeling = feeling[:, None].astype(np.float64)

    def __call__(self, readings: Readings) -> Readings:
        """Return the readings, 0 where nothing is felt."""
        felt: Readings = readings * self._feeling
        return felt


class Thresholded:
    """Tells touched from untouched.

    Args:
        above: Readings above it are 1, others 0.
    """

    def __init__(self, above: float) -> None:
        self._above = above

    def __call__(self, readings: Readings) -> Readings:
        """Return zeros and ones."""
        return (readings > self._above).astype(np.float64)


class Averaged:
    """Blurs patches to their mean.

    Args:
        first_triangle: Where each patch begins; the last one ends at the last triangle.
    """

    def __init__(self, first_triangle: NDArray[np.int64]) -> None:
        self._first = first_triangle

    def __call__(self, readings: Readings) -> Readings:
        """Return the mean of its patch for every taxel."""
        sizes = np.diff(self._first, append=len(readings))
        means = np.add.reduceat(readings.sum(axis=1), self._first) / (sizes * readings.shape[1])
        return np.repeat(means, sizes)[:, None].repeat(readings.shape[1], axis=1)


def _of_hands(skeleton: Skeleton) -> Bools:
    """Mask ``(1648,)`` of the triangles of hands and fingers."""
    hands = [bone.name.endswith("_hand") for bone in skeleton.bones]
    for index, bone in enumerate(skeleton.bones):
        hands[index] |= bone.parent >= 0 and hands[bone.parent]
    return np.repeat(hands, np.diff(load_taxels().first_triangle))

"""The qualities of touch: transforms of the taxel readings that keep their shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Skeleton, load_skeleton
from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.touch.taxels import load_taxels

Transform = Callable[[Floats], Floats]


class TouchQuality(Enum):
    """The resolution of the skin. It changes the content of the observation, never its shape.

    Attributes:
        skin: The reading of every taxel.
        hands: Only the taxels of hands and fingers; the others read 0.
        binary: 1 where a reading exceeds `TouchCfg.binary_above`, else 0.
        coarse: Every taxel of a bone reads the mean of all taxels of the bone.
    """

    skin = "skin"
    hands = "hands"
    binary = "binary"
    coarse = "coarse"


def make_transform(quality: TouchQuality, binary_above: float) -> Transform:
    """Return the transform ``(1648, 6) -> (1648, 6)`` of a quality.

    Args:
        quality: See `TouchQuality`.
        binary_above: Threshold of `binary`.
    """
    match quality:
        case TouchQuality.skin:
            return identity
        case TouchQuality.hands:
            return Mask(hand_triangles(load_skeleton()))
        case TouchQuality.binary:
            return Threshold(binary_above)
        case TouchQuality.coarse:
            return PatchMean(load_taxels().first_triangle[:-1])


def identity(readings: Floats) -> Floats:
    """Return the readings as they are."""
    return readings


class Mask:
    """Sets the readings of some triangles to 0.

    Args:
        kept: ``(1648,)`` which triangles keep their readings.
    """

    def __init__(self, kept: Bools) -> None:
        self._kept = kept[:, None].astype(np.float64)

    def __call__(self, readings: Floats) -> Floats:
        """Return the masked readings."""
        masked: Floats = readings * self._kept
        return masked


@dataclass(frozen=True)
class Threshold:
    """Sets readings above a threshold to 1 and the others to 0.

    Attributes:
        above: The threshold.
    """

    above: float

    def __call__(self, readings: Floats) -> Floats:
        """Return zeros and ones."""
        return (readings > self.above).astype(np.float64)


class PatchMean:
    """Replaces each reading by the mean of its patch.

    Args:
        first_triangle: Index of the first triangle of each patch; the last patch ends at the last
            triangle.
    """

    def __init__(self, first_triangle: NDArray[np.int64]) -> None:
        self._first = first_triangle

    def __call__(self, readings: Floats) -> Floats:
        """Return the mean of its patch for every taxel."""
        sizes = np.diff(self._first, append=len(readings))
        means = np.add.reduceat(readings.sum(axis=1), self._first) / (sizes * readings.shape[1])
        return np.repeat(means, sizes)[:, None].repeat(readings.shape[1], axis=1)


def hand_triangles(skeleton: Skeleton) -> Bools:
    """Return the mask ``(1648,)`` of the triangles of hands and fingers."""
    hands = [bone.name.endswith("_hand") for bone in skeleton.bones]
    for index, bone in enumerate(skeleton.bones):
        hands[index] |= bone.parent >= 0 and hands[bone.parent]
    return np.repeat(hands, np.diff(load_taxels().first_triangle))

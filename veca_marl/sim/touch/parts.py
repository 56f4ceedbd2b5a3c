"""Named parts of the skin, such as the left palm or the tip of the right thumb.

Parts divide the skin by bone and by the direction that a triangle faces in the frame of its bone
in the binding pose: x to the front, y to the left and z upwards, arms and legs down. Left and right
parts mirror each other.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.body.anatomy import binding_pose, load_skeleton, load_skin
from veca_marl.sim.geometry import Bools, Floats, Indices
from veca_marl.sim.touch.taxels import TAXELS_PER_TRIANGLE, bound_triangles

FINGERS = ("thumb", "index", "middle", "ring", "little")
_SOLE_DOWN = -0.5  # z of the normal of a triangle that belongs to the sole
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the skin.

    Attributes:
        name: Such as `l_palm` or `chest_front`.
        triangles: Indices of its triangles; each has six taxels.
    """

    name: str
    triangles: Indices

    @property
    def taxels(self) -> Indices:
        """Indices of its taxels in the observation `touch`."""
        first = TAXELS_PER_TRIANGLE * self.triangles[:, None]
        taxels: Indices = (first + np.arange(TAXELS_PER_TRIANGLE)).ravel()
        return taxels


@functools.cache
def skin_parts() -> tuple[Part, ...]:
    """Return the parts of the skin, from head to feet, left before right.

    Each triangle is in exactly one of them.
    """
    names = _names_of_triangles()
    return tuple(Part(name, np.flatnonzero(names == name)) for name in _part_names())


class PartReadings:
    """Computes mean and maximum of each part from the readings of all taxels."""

    def __init__(self) -> None:
        parts = skin_parts()
        self._order = np.concatenate([part.triangles for part in parts])
        sizes = np.array([len(part.triangles) for part in parts])
        self._first = np.cumsum(sizes) - sizes
        self._taxels = sizes * TAXELS_PER_TRIANGLE
        self.size = 2 * len(parts)

    def __call__(self, readings: Floats) -> Floats:
        """Return the means of all parts, then their maxima, ``(2 * parts,)`` in [0, 1].

        Args:
            readings: ``(1648, 6)`` in [0, 1].
        """
        sums = np.add.reduceat(readings.sum(axis=1)[self._order], self._first)
        maxima = np.maximum.reduceat(readings.max(axis=1)[self._order], self._first)
        return np.concatenate((sums / self._taxels, maxima))


def _part_names() -> list[str]:
    """Return the names of all parts in the order of the observation."""
    names = [f"head_{side}" for side in ("front", "back", "left", "right", "top")]
    names += [f"{bone}_{side}" for bone in _TRUNK for side in ("front", "back")]
    for limb in (_arm_parts(), _LEG):
        names += [f"{side}_{part}" for part in limb for side in "lr"]
    return names


def _arm_parts() -> list[str]:
    bones = [f"{bone}_{side}" for bone in ("upper_arm", "forearm") for side in ("front", "back")]
    fingers = [f"{finger}_{end}" for finger in FINGERS for end in ("base", "tip")]
    return [*bones, "palm", "hand_back", *fingers]


_TRUNK = ("neck", "chest", "spine", "pelvis")
_LEG = (
    *("thigh_front", "thigh_back", "shank_front", "shank_back"),
    *("foot_top", "sole_front", "heel"),
)


def _names_of_triangles() -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    """Return the name of the part of each triangle, ``(1648,)``."""
    skeleton, owners = load_skeleton(), load_skin().owners
    centres, normals = bound_triangles()
    positions, rotations = binding_pose(skeleton)
    names = np.full(len(owners), "", "U32")
    for index, bone in enumerate(skeleton.bones):
        own = owners == index
        facing = normals[own] @ rotations[index]
        ahead = ((centres[own] - positions[index]) @ rotations[index])[:, 0]
        names[own] = _names_on_bone(bone.name, facing, ahead > bone.tip[0] / 2)
    return names


def _names_on_bone(bone: str, facing: Floats, distal: Bools) -> list[str]:
    """Return the names of the parts of the triangles of one bone.

    Args:
        bone: Its name.
        facing: ``(t, 3)`` normals in its frame.
        distal: ``(t,)`` whether they lie on its front half.
    """
    front = np.where(facing[:, 0] > _ROUNDING, "front", "back")
    if bone == "head":
        return [f"head_{_dominant(normal)}" for normal in facing]
    if bone in _TRUNK:
        return [f"{bone}_{side}" for side in front]
    side, _, part = bone.partition("_")
    if part == "hand":
        inward = -facing[:, 1] if side == "l" else facing[:, 1]
        return [f"{side}_palm" if way > _ROUNDING else f"{side}_hand_back" for way in inward]
    if part == "foot":
        return [
            f"{side}_{_foot_part(normal[2], far)}"
            for normal, far in zip(facing, distal, strict=True)
        ]
    finger, _, phalanx = part.partition("_")
    if finger in FINGERS:
        return [f"{side}_{finger}_{'tip' if phalanx == 'distal' else 'base'}"] * len(facing)
    return [f"{bone}_{way}" for way in front]


def _dominant(normal: Floats) -> str:
    """Return the side of the head that a triangle faces most."""
    axis = int(np.abs(normal).argmax())
    if axis == 2 and normal[2] > 0.0:
        return "top"
    if axis == 1:
        return "left" if normal[1] > 0.0 else "right"
    return "front" if normal[0] > _ROUNDING else "back"


def _foot_part(up: float, distal: bool) -> str:
    """Return the part of a foot by the vertical component of the normal."""
    if up > _SOLE_DOWN:
        return "foot_top"
    return "sole_front" if distal else "heel"

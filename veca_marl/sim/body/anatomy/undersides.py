"""The lowest points of bodies, from which they are placed on the floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.geometry import Floats, Primitive, Shape


class Underside:
    """The lowest point of some bones: of the corners of boxes and of the caps of capsules.

    Args:
        skeleton: The skeleton.
        bones: Names of the bones.
        skin: Whether their flexible skin counts, or the rigid bones alone.
    """

    def __init__(self, skeleton: Skeleton, bones: Sequence[str], skin: bool) -> None:
        points: list[tuple[int, Floats, float]] = []
        for name in bones:
            frame = skeleton.bone(name)
            skin_m = skeleton.bones[frame].skin_thickness_m if skin else 0.0
            for part in skeleton.bones[frame].colliders:
                points += [(frame, at, radius + skin_m) for at, radius in _extremes(part)]
        self._frames = np.array([frame for frame, _, _ in points])
        self._offsets = np.array([offset for _, offset, _ in points])
        self._radii = np.array([radius for _, _, radius in points])

    def lowest_m(self, positions: Floats, rotations: Floats) -> float:
        """Return the height of the lowest point.

        Args:
            positions: ``(47, 3)`` bone origins, metres.
            rotations: ``(47, 3, 3)`` bone rotations.
        """
        up = rotations[self._frames, 2]
        heights = positions[self._frames, 2] + (up * self._offsets).sum(axis=1) - self._radii
        return float(heights.min())


class Soles(Underside):
    """The undersides of both feet, without skin: the skin is compressed by the body's weight."""

    def __init__(self, skeleton: Skeleton) -> None:
        super().__init__(skeleton, ("l_foot", "r_foot"), skin=False)


def _extremes(part: Primitive) -> list[tuple[Floats, float]]:
    """Return points and the radius of the ball at each, which have the hull of the primitive."""
    if part.shape is not Shape.BOX:
        return [(centre, part.radius) for centre in part.cap_centres()]
    return [(corner, 0.0) for corner in part.corners()]

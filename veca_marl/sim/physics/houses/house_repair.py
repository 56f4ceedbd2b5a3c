"""The law of generated houses: a walker reaches every position with some space round it.

`FreeFloor` rejects most pieces of furniture that would close a position off while they are placed,
room by room, with bounding rectangles that are rounded up to its cells: gaps look narrower than
they are, so that it overlooks positions in some of them. Here the whole house is measured with the
exact shapes that are built.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.physics.houses.footprints import Footprint
from veca_marl.sim.physics.rooms import RoomCfg

NODE_M = 0.02
"""Distance of the points at which distances are computed."""

_TIE_M = 1e-6  # distances are often equal to a limit: all lengths are whole centimetres
_STRIDES = (1, 2)  # a fine grid finds small areas, a coarse one passages that are hardly wide


@dataclass(frozen=True)
class WalkerLaw:
    """What a walker reaches.

    Attributes:
        radius_m: Its radius.
        height_m: What begins above this height is not in its way.
        space_m: Positions that are so far away from walls and things are all connected.
        closed_off_m2: Greatest area of the positions that have less space and are closed off.
    """

    radius_m: float = 0.11
    height_m: float = 0.75
    space_m: float = 0.15
    closed_off_m2: float = 0.008

    def closed_off(self, clearance_m: Floats, cell_m: float) -> Bools:
        """Return where a walker fits but does not arrive, if this breaks the law.

        Args:
            clearance_m: ``(nx, ny)`` distance of points of a square grid from the nearest thing.
            cell_m: Distance of the points.

        Returns:
            ``(nx, ny)``; all are False where the law holds.
        """
        beyond = _beyond_largest(clearance_m >= self.radius_m - _TIE_M)
        has_space = bool((clearance_m[beyond] >= self.space_m - _TIE_M).any())
        is_large = float(beyond.sum()) * cell_m**2 > self.closed_off_m2 + _TIE_M
        return beyond if has_space or is_large else np.zeros_like(beyond)


def _beyond_largest(free: Bools) -> Bools:
    """Return which free cells are not in the largest connected area."""
    labels, count = ndimage.label(free)
    if count < 2:
        return np.zeros_like(free)
    beyond: Bools = free & (labels != 1 + int(np.argmax(np.bincount(labels.ravel())[1:])))
    return beyond


WITH_LEAVES = WalkerLaw(space_m=0.2, closed_off_m2=0.048)
"""The law where leaves stand open, which leave small areas behind them."""


class WalkerFloor:
    """Distances of a grid of points, over all rooms, from walls and things.

    Args:
        rooms: The rooms of a house with walls.
        things: What is in the way, with sides along x and y.
        reach_m: Greatest distance that matters.

    Attributes:
        clearance_m: ``(nx, ny)`` distance of each point, at most `reach_m`; 0 inside of things.
    """

    def __init__(
        self, rooms: Sequence[RoomCfg], things: Sequence[Footprint], reach_m: float
    ) -> None:
        low = np.min([room.lower_m[:2] for room in rooms], axis=0)
        high = np.max([np.add(room.lower_m, room.size_m)[:2] for room in rooms], axis=0)
        self._axes: list[Floats] = [
            np.arange(begin, end + NODE_M, NODE_M) for begin, end in zip(low, high, strict=True)
        ]
        self._low: Floats = low
        self.clearance_m: Floats = np.full([len(axis) for axis in self._axes], reach_m)
        for thing in things:
            near = self._near(thing, reach_m)
            self.clearance_m[near] = np.minimum(self.clearance_m[near], self._away_m(thing, near))

    def closed_off(self, law: WalkerLaw) -> Floats:
        """Return the points ``(n, 2)`` that break a law, metres; none where it holds."""
        found = [np.empty((0, 2))]
        for stride in _STRIDES:
            # the points of the coarse grid are the middles of cells from the corner of the house on
            taken = slice(stride - 1, None, stride)
            beyond = law.closed_off(self.clearance_m[taken, taken], stride * NODE_M)
            x, y = np.nonzero(beyond)
            points = [axis[taken][cells] for axis, cells in zip(self._axes, (x, y), strict=True)]
            found.append(np.stack(points, axis=-1))
        return np.concatenate(found)

    def _near(self, thing: Footprint, reach_m: float) -> tuple[slice, slice]:
        """Return the points that can be nearer to a thing than a distance."""
        spread = np.array(_half_m(thing)) + thing.radius_m + reach_m
        first = np.floor((np.array(thing.centre_m) - spread - self._low) / NODE_M).astype(int)
        end = np.ceil((np.array(thing.centre_m) + spread - self._low) / NODE_M).astype(int) + 1
        x, y = (
            slice(max(begin, 0), max(stop, 0))
            for begin, stop in zip(first.tolist(), end.tolist(), strict=True)
        )
        return x, y

    def _away_m(self, thing: Footprint, near: tuple[slice, slice]) -> Floats:
        x, y = (axis[part] for axis, part in zip(self._axes, near, strict=True))
        return distance_m(thing, x[:, None], y[None, :])


def distance_m(thing: Footprint, x: Floats, y: Floats) -> Floats:
    """Return the distance of points to a thing with sides along x and y, or a round one, metres."""
    half_x, half_y = _half_m(thing)
    out_x = np.maximum(np.abs(x - thing.centre_m[0]) - half_x, 0.0)
    out_y = np.maximum(np.abs(y - thing.centre_m[1]) - half_y, 0.0)
    away: Floats = np.maximum(np.hypot(out_x, out_y) - thing.radius_m, 0.0)
    return away


def _half_m(thing: Footprint) -> tuple[float, float]:
    """Return half of the extents along x and y of what a thing consists of round its middle.

    A round thing is all within its radius of its middle.
    """
    if thing.radius_m:
        return 0.0, 0.0
    cos, sin = abs(math.cos(thing.yaw_rad)), abs(math.sin(thing.yaw_rad))
    width, depth = thing.half_m
    return cos * width + sin * depth, sin * width + cos * depth

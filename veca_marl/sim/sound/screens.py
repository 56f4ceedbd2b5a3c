"""The screens of a house from its obstacles: where they end, and what they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.blocked_paths import contains_point, extends_into
from veca_marl.sim.sound.diffraction import BOX, CLOSED, LEAF, Screens

Boxes = tuple[Floats, Floats, Floats]
"""Centres ``(n, 3)``, rotations ``(n, 3, 3)`` and halves of edges ``(n, 3)`` of boxes, see
`blocked_paths`."""

_GAP_M = 0.1
"""From this distance to the floor, the ceiling or a wall of its room, the gap beside a box closes
gradually."""

_TOUCHING_M = 0.02
_REBATE_M = 0.015
"""By which a frame overlaps the leaf that it holds: a closed door has no gap."""

_OPEN_RATIO = 1.0
"""Way of a leaf over its width from which on it stands apart from its opening: a hinged leaf at 60
degrees."""


class ScreenSets(NamedTuple):
    """The screens of a house, and which of them count where.

    Attributes:
        screens: All of them: boxes, leaves, and the same leaves closed.
        between: ``(n,)`` numbers of those that count for paths between rooms: all but outer walls.
        inside: For each room, the numbers of those that reach into it.
    """

    screens: Screens
    between: NDArray[np.int64]
    inside: list[NDArray[np.int64]]


def find_screens(
    boxes: Boxes, leaves: Boxes, closed: Boxes, lower: Floats, upper: Floats
) -> ScreenSets:
    """Return the screens of a house.

    Args:
        boxes: Walls and furniture.
        leaves: Leaves of doors where they are now.
        closed: The same leaves where they are closed.
        lower: ``(rooms, 3)`` metres, corners of the rooms.
        upper: Likewise.
    """
    widened = leaves[2] + _REBATE_M * (leaves[2] > leaves[2].min(axis=1, keepdims=True))
    parts = boxes, (leaves[0], leaves[1], widened), (closed[0], closed[1], widened)
    centres, rotations, halves = (np.concatenate(part) for part in zip(*parts, strict=True))
    n_boxes = len(boxes[0])
    rooms = _rooms_of(centres, lower, upper)
    rooms[n_boxes:] = -1  # a leaf that is open reaches out of its opening
    bounds = _bounds(centres, rotations, halves, rooms, lower, upper)
    joints = np.zeros_like(bounds)
    joints[:n_boxes] = _joints(*boxes, rooms[:n_boxes])
    numbers = np.arange(len(centres))
    opens = np.full(len(centres), -1.0)
    opens[n_boxes:] = np.tile(_openness(leaves, closed), 2)
    kinds = np.repeat([BOX, LEAF, CLOSED], [n_boxes, len(leaves[0]), len(leaves[0])])
    screens = Screens(centres, rotations, halves, bounds, joints, rooms, kinds, opens)
    amid = ((centres > lower.min(axis=0)) & (centres < upper.max(axis=0))).all(axis=1)
    inside = [
        np.array([n for n in numbers if _is_inside(screens, int(n), low, high - low)], np.int64)
        for low, high in zip(lower, upper, strict=True)
    ]
    return ScreenSets(screens, numbers[amid], inside)


def _is_inside(screens: Screens, number: int, lower: Floats, size: Floats) -> bool:
    """Return whether a screen reaches into a room."""
    box = screens.centres[number], screens.rotations[number], screens.halves[number]
    return bool(extends_into(*box, lower, size))


def _openness(leaves: Boxes, closed: Boxes) -> Floats:
    """Return how far each leaf is open, ``(n,)`` from 0 to 1."""
    centres, rotations, halves = leaves
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8)
    corners = halves[:, :, None] * signs
    now = centres[..., None] + rotations @ corners
    shut = closed[0][..., None] + closed[1] @ corners
    moved = np.linalg.norm(now - shut, axis=1).max(axis=1, initial=0.0)
    width = 2.0 * np.sort(halves, axis=1)[:, 1]
    openness: Floats = np.minimum(moved / (_OPEN_RATIO * width), 1.0)
    return openness


@njit(cache=True)
def _rooms_of(centres: Floats, lower: Floats, upper: Floats) -> NDArray[np.int64]:
    """Return which room contains each point ``(n, 3)``, -1 for none."""
    rooms = np.full(len(centres), -1)
    for n in range(len(centres)):
        for room in range(len(lower)):
            if ((centres[n] > lower[room]) & (centres[n] < upper[room])).all():
                rooms[n] = room
                break
    return rooms


@njit(cache=True)
def _bounds(
    centres: Floats,
    rotations: Floats,
    halves: Floats,
    rooms: NDArray[np.int64],
    lower: Floats,
    upper: Floats,
) -> Floats:
    """Return how far each face meets the end of the air, see `Screens.bounds`.

    The air of furniture is its room, that of walls the box round all rooms; the large faces of a
    wall meet nothing.
    """
    bounds = np.zeros((len(centres), 3, 2))
    for n in range(len(centres)):
        low, high = lower[max(rooms[n], 0)].copy(), upper[max(rooms[n], 0)].copy()
        if rooms[n] < 0:
            for axis in range(3):
                low[axis], high[axis] = lower[:, axis].min(), upper[:, axis].max()
        thin = np.argmin(halves[n])
        for k in range(3):
            if rooms[n] < 0 and k == thin:
                continue
            world = np.argmax(np.abs(rotations[n, :, k]))
            aligned = max(1.0 - 10.0 * (1.0 - abs(rotations[n, world, k])), 0.0)
            extent = 0.0
            for j in range(3):
                extent += abs(rotations[n, world, j]) * halves[n, j]
            below = centres[n, world] - extent - low[world]
            above = high[world] - centres[n, world] - extent
            ends = (
                aligned * max(1.0 - max(below, 0.0) / _GAP_M, 0.0),
                aligned * max(1.0 - max(above, 0.0) / _GAP_M, 0.0),
            )
            up = 1 if rotations[n, world, k] > 0.0 else 0
            bounds[n, k, up], bounds[n, k, 1 - up] = ends[1], ends[0]
    return bounds


@njit(cache=True)
def _joints(centres: Floats, rotations: Floats, halves: Floats, rooms: NDArray[np.int64]) -> Floats:
    """Return which faces of walls meet another wall, see `Screens.joints`."""
    joints = np.zeros((len(centres), 3, 2))
    for n in range(len(centres)):
        if rooms[n] >= 0:
            continue
        thin = np.argmin(halves[n])
        for k in range(3):
            for side in range(2):
                if k == thin:
                    continue
                out = (halves[n, k] + _TOUCHING_M) * (1.0 if side == 1 else -1.0)
                point = centres[n] + out * rotations[n, :, k]
                for other in range(len(centres)):
                    if other == n or rooms[other] >= 0:
                        continue
                    if contains_point(point, centres[other], rotations[other], halves[other]):
                        joints[n, k, side] = 1.0
    return joints

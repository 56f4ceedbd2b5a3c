"""Screens of sound: how walls, furniture and leaves of doors stand in the rooms of a house."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.sound.silhouettes import BOX, CLOSED, LEAF, Screens

Boxes = tuple[Floats, Floats, Floats]
"""Centres ``(n, 3)``, rotations ``(n, 3, 3)`` and halves of edges ``(n, 3)`` of boxes."""

_GAP_M = 0.1
"""From this distance to the floor, the ceiling or a wall of its room, the gap beside a box closes
gradually."""

_TOUCHING_M = 0.02
_REBATE_M = 0.015
"""By which a frame overlaps the leaf that it holds, since a closed door has no gap."""

_OPEN_RATIO = 0.8
"""Way of a leaf over its width from which on it stands apart from its opening, a hinged leaf at 47
degrees and a sliding one of which 12 cm stay in the opening."""

_INSIDE_M = 1e-3
"""A box counts as inside a room if it extends into it by more than this; walls touch the room."""


_OPENING_M = 1e-3  # half of the thickness of an opening, which lies in the plane of a wall


@dataclass(frozen=True)
class Doorway:
    """An opening in the wall between two rooms, from the floor up to what is above it.

    Attributes:
        rooms: Numbers of the two rooms.
        position_m: Middle of its threshold, x and y, metres.
        width_m: Its width.
        axis: 0 if it leads along x, 1 if along y.
    """

    rooms: tuple[int, int]
    position_m: tuple[float, float]
    width_m: float
    axis: int


class ScreenSets(NamedTuple):
    """The screens of a house, and which of them count where.

    Attributes:
        screens: All of them: boxes, leaves, and the same leaves closed.
        between: ``(n,)`` numbers of those that count for paths between rooms: all but outer walls.
        inside: For each room, the numbers of those that reach into it.
        openings: For each room, the doorways in the planes of its walls, which do not reflect. The
            kind of each is twice the axis of the wall, plus 1 for the one at the greater
            coordinate; `Screens.opens` is 1 without a leaf.
    """

    screens: Screens
    between: NDArray[np.int64]
    inside: list[NDArray[np.int64]]
    openings: list[Screens]


def find_screens(
    boxes: Boxes,
    leaves: Boxes,
    closed: Boxes,
    fixed: NDArray[np.bool_],
    lower: Floats,
    upper: Floats,
    doorways: Sequence[Doorway],
) -> ScreenSets:
    """Return the screens of a house.

    Args:
        boxes: Walls and furniture.
        leaves: Leaves of doors where they are now.
        closed: The same leaves where they are closed.
        fixed: Which boxes are walls where they stand between rooms.
        lower: ``(rooms, 3)`` metres, corners of the rooms.
        upper: Likewise.
        doorways: Between the rooms.
    """
    widened = leaves[2] + _REBATE_M * (leaves[2] > leaves[2].min(axis=1, keepdims=True))
    parts = boxes, (leaves[0], leaves[1], widened), (closed[0], closed[1], widened)
    centres, rotations, halves = (np.concatenate(part) for part in zip(*parts, strict=True))
    n_boxes = len(boxes[0])
    walls = np.concatenate([fixed, np.ones(len(centres) - n_boxes, bool)])
    rooms = _rooms_of(centres, walls, lower, upper)
    rooms[n_boxes:] = -1  # a leaf that is open reaches out of its opening
    doors = _doorways_in_walls(doorways, lower, upper)
    bounds = _bounds(centres, rotations, halves, rooms, lower, upper, doors)
    joints = np.zeros_like(bounds)
    joints[:n_boxes] = _joints(*boxes, rooms[:n_boxes])
    numbers = np.arange(len(centres))
    opens = np.full(len(centres), -1.0)
    openness = _openness(leaves, closed)
    opens[n_boxes:] = np.tile(openness, 2)
    kinds = np.repeat([BOX, LEAF, CLOSED], [n_boxes, len(leaves[0]), len(leaves[0])])
    own = np.concatenate([np.full(n_boxes, -1), np.tile(np.arange(len(leaves[0])), 2)])
    air = _air(centres, rotations, halves, rooms, lower, upper)
    screens = Screens(centres, rotations, halves, bounds, joints, rooms, air, kinds, opens, own)
    amid = ((centres > lower.min(axis=0)) & (centres < upper.max(axis=0))).all(axis=1)
    inside = [
        np.array([n for n in numbers if _is_inside(screens, int(n), low, high - low)], np.int64)
        for low, high in zip(lower, upper, strict=True)
    ]
    openings = [
        _openings(doorways, room, boxes, (closed, openness), lower, upper)
        for room in range(len(lower))
    ]
    return ScreenSets(screens, numbers[amid], inside, openings)


def _openings(
    doorways: Sequence[Doorway],
    room: int,
    boxes: Boxes,
    leaves: tuple[Boxes, Floats],
    lower: Floats,
    upper: Floats,
) -> Screens:
    """Return the doorways in the walls of a room, see `ScreenSets.openings`.

    Args:
        doorways: Of all rooms.
        room: Number of the room.
        boxes: Walls and furniture.
        leaves: Where leaves are closed, and how far they are open ``(n,)``.
        lower: ``(rooms, 3)`` metres, corners of the rooms.
        upper: Likewise.
    """
    own = [doorway for doorway in doorways if room in doorway.rooms]
    centres, halves = np.zeros((len(own), 3)), np.zeros((len(own), 3))
    kinds, opens = np.zeros(len(own), np.int64), np.ones(len(own))
    low, high = lower[room], upper[room]
    for n, doorway in enumerate(own):
        at, axis = np.array(doorway.position_m), doorway.axis
        is_upper = _is_upper(doorway, low, high)
        top = _lintel_m(at, boxes, float(high[2]))
        centres[n] = *at, (low[2] + top) / 2.0
        centres[n, axis] = (high if is_upper else low)[axis]
        halves[n, 1 - axis], halves[n, 2] = doorway.width_m / 2.0, (top - low[2]) / 2.0
        halves[n, axis] = _OPENING_M
        kinds[n] = 2 * axis + is_upper
        away = np.linalg.norm(leaves[0][0][:, :2] - at, axis=1)
        if len(away) and away.min() < doorway.width_m / 2.0:
            opens[n] = leaves[1][away.argmin()]
    none = np.full(len(own), -1)
    rotations = np.repeat(np.eye(3)[None], len(own), axis=0)
    bounds = _bounds(centres, rotations, halves, none, lower, upper, np.zeros((0, 4)))
    joints, air = np.zeros_like(bounds), np.zeros((len(own), 2, 3))
    behind = np.array([sum(doorway.rooms) - room for doorway in own], np.int64)
    return Screens(centres, rotations, halves, bounds, joints, behind, air, kinds, opens, none)


def _doorways_in_walls(doorways: Sequence[Doorway], lower: Floats, upper: Floats) -> Floats:
    """Return where the walls of rooms have doorways.

    Args:
        doorways: Between the rooms.
        lower: ``(rooms, 3)`` metres, corners of the rooms.
        upper: Likewise.

    Returns:
        ``(n, 4)``: room, wall (see `ScreenSets.openings`), and the ends of the doorway in metres.
    """
    rows = [
        (
            room,
            2 * doorway.axis + _is_upper(doorway, lower[room], upper[room]),
            doorway.position_m[1 - doorway.axis] - doorway.width_m / 2.0,
            doorway.position_m[1 - doorway.axis] + doorway.width_m / 2.0,
        )
        for doorway in doorways
        for room in doorway.rooms
    ]
    return np.array(rows, np.float64).reshape(-1, 4)


def _is_upper(doorway: Doorway, lower: Floats, upper: Floats) -> bool:
    """Return whether a doorway is in the wall of a room that is at the greater coordinate."""
    axis = doorway.axis
    return bool(doorway.position_m[axis] > (lower[axis] + upper[axis]) / 2.0)


def _lintel_m(position: Floats, boxes: Boxes, ceiling_m: float) -> float:
    """Return the height of what is above a threshold ``(2,)``, the ceiling if nothing is."""
    centres, rotations, halves = boxes
    extents = (np.abs(rotations) * halves[:, None]).sum(axis=2)
    above = (np.abs(centres[:, :2] - position) < extents[:, :2]).all(axis=1)
    bottoms = (centres - extents)[above, 2]
    return float(min(bottoms.min(initial=ceiling_m), ceiling_m))


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


@compiled
def _rooms_of(
    centres: Floats, walls: NDArray[np.bool_], lower: Floats, upper: Floats
) -> NDArray[np.int64]:
    """Return which room contains each point ``(n, 3)``; that of a wall may be none, -1.

    A point of other things that is in no room belongs to the nearest one.
    """
    rooms = np.full(len(centres), -1)
    for n in range(len(centres)):
        for room in range(len(lower)):
            if ((centres[n] > lower[room]) & (centres[n] < upper[room])).all():
                rooms[n] = room
                break
        if rooms[n] < 0 and not walls[n]:
            rooms[n] = nearest_box(centres[n], lower, upper)
    return rooms


@compiled
def _air(
    centres: Floats,
    rotations: Floats,
    halves: Floats,
    rooms: NDArray[np.int64],
    lower: Floats,
    upper: Floats,
) -> Floats:
    """Return where furniture counts, ``(n, 2, 3)`` metres, see `Screens.air`.

    The part behind a face of the room grows from nothing to all of the house as furniture is moved
    through that face, up to its middle.
    """
    air = np.zeros((len(centres), 2, 3))
    for n in range(len(centres)):
        room = max(rooms[n], 0)
        for axis in range(3):
            through = _through_faces(
                centres[n, axis], _extent(rotations[n, axis], halves[n]), lower[room, axis],
                upper[room, axis],
            )  # fmt: skip
            low, high = lower[:, axis].min(), upper[:, axis].max()
            air[n, 0, axis] = lower[room, axis] + through[0] * (low - lower[room, axis])
            air[n, 1, axis] = upper[room, axis] + through[1] * (high - upper[room, axis])
    return air


@kernel
def _extent(rotation: Floats, half: Floats) -> float:
    """Return by how much a box reaches along an axis, given that row ``(3,)`` of its rotation."""
    extent = 0.0
    for k in range(3):
        extent += abs(rotation[k]) * half[k]
    return extent


@kernel
def _through_faces(centre: float, extent: float, lower: float, upper: float) -> tuple[float, float]:
    """Return how far something is through two faces of a room, 1 where its middle is in one."""
    below = min(max((lower - centre + extent) / extent, 0.0), 1.0)
    above = min(max((centre + extent - upper) / extent, 0.0), 1.0)
    return below, above


@compiled
def _bounds(
    centres: Floats,
    rotations: Floats,
    halves: Floats,
    rooms: NDArray[np.int64],
    lower: Floats,
    upper: Floats,
    doors: Floats,
) -> Floats:
    """Return how far each face meets the end of the air, see `Screens.bounds`.

    The air of furniture is its room, that of walls the box round all rooms; the large faces of a
    wall meet nothing, and neither does the part of a face that is before a doorway, see
    `_doorways_in_walls`.
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
            extent = _extent(rotations[n, world], halves[n])
            below = centres[n, world] - extent - low[world]
            above = high[world] - centres[n, world] - extent
            ends = (
                aligned * max(1.0 - max(below, 0.0) / _GAP_M, 0.0),
                aligned * max(1.0 - max(above, 0.0) / _GAP_M, 0.0),
            )
            if rooms[n] >= 0 and world < 2:
                across = centres[n, 1 - world], _extent(rotations[n, 1 - world], halves[n])
                lost = _before_doorways(rooms[n], int(world), across, doors)
                ends = ends[0] * (1.0 - lost[0]), ends[1] * (1.0 - lost[1])
            up = 1 if rotations[n, world, k] > 0.0 else 0
            bounds[n, k, up], bounds[n, k, 1 - up] = ends[1], ends[0]
    return bounds


@kernel
def _before_doorways(
    room: int, axis: int, across: tuple[float, float], doors: Floats
) -> tuple[float, float]:
    """Return the fractions of two faces of a box that are before doorways of its room.

    Args:
        room: Its room.
        axis: Of the world, across the faces; those in its negative and positive direction.
        across: Middle and half of its extent along the other horizontal axis, in metres.
        doors: See `_doorways_in_walls`.
    """
    below = above = 0.0
    centre, extent = across
    for n in range(len(doors)):
        if doors[n, 0] == room and doors[n, 1] // 2 == axis:
            low, high = max(doors[n, 2], centre - extent), min(doors[n, 3], centre + extent)
            lost = max(high - low, 0.0) / (2.0 * extent)
            if doors[n, 1] % 2 == 1:
                above += lost
            else:
                below += lost
    return min(below, 1.0), min(above, 1.0)


@compiled
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


@kernel
def contains_point(point: Floats, centre: Floats, rotation: Floats, half: Floats) -> bool:
    """Return whether a point is in a box.

    Args:
        point: ``(3,)`` metres.
        centre: ``(3,)`` metres.
        rotation: ``(3, 3)`` from the axes of the box to the world's.
        half: ``(3,)`` metres, half of its edges.
    """
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += (point[k] - centre[k]) * rotation[k, axis]
        if abs(along) > half[axis]:
            return False
    return True


@kernel
def extends_into(
    centre: Floats, rotation: Floats, half: Floats, lower: Floats, size: Floats
) -> bool:
    """Return whether the box round a box reaches into a room with this corner and size."""
    for axis in range(3):
        extent = 0.0
        for k in range(3):
            extent += abs(rotation[axis, k]) * half[k]
        below = centre[axis] + extent - lower[axis]
        above = lower[axis] + size[axis] - (centre[axis] - extent)
        if min(below, above) < _INSIDE_M:
            return False
    return True


@kernel
def nearest_box(point: Floats, lower: Floats, upper: Floats) -> int:
    """Return which of the boxes ``(n, 3)`` is nearest to a point ``(3,)``, the first of equals."""
    nearest, least = 0, np.inf
    for n in range(len(lower)):
        outside = 0.0
        for axis in range(3):
            out = max(lower[n, axis] - point[axis], point[axis] - upper[n, axis], 0.0)
            outside += out * out
        if outside < least:
            nearest, least = n, outside
    return nearest

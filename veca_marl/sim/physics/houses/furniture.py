"""Furniture: which piece is where, what it is built of, and checks that it fits into its room.

Sizes are those of common household furniture. Each piece is described in its own frame: x along its
back, y from the back to the front, z up, with the origin in the middle of its floor area.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

from veca_marl.sim.physics.houses.footprints import Footprint, footprints, overlap_m
from veca_marl.sim.physics.props import PartCfg, PropCfg, PropShape, check_appearance
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg


class FurnitureKind(Enum):
    """Kinds of furniture, see `veca_marl.sim.physics.houses.furniture` for their sizes."""

    armchair = "armchair"
    bathtub = "bathtub"
    bed = "bed"
    chair = "chair"
    cot = "cot"
    counter = "counter"
    desk = "desk"
    dresser = "dresser"
    fridge = "fridge"
    lamp = "lamp"
    plant = "plant"
    shelf = "shelf"
    sofa = "sofa"
    stool = "stool"
    table = "table"
    toilet = "toilet"
    toy_chest = "toy_chest"
    tv_stand = "tv_stand"
    wardrobe = "wardrobe"
    washbasin = "washbasin"


@dataclass
class FurnitureCfg:
    """One piece of furniture, a fixed part of the world.

    Attributes:
        name: Unique in its playground.
        kind: What it is.
        position_m: The middle of its floor area, x and y.
        yaw_deg: Rotation about z. At 0 its back faces -y.
        colour: Red, green, blue in [0, 1] of its main part.
    """

    name: str = ""
    kind: FurnitureKind = FurnitureKind.table
    position_m: tuple[float, float] = (0.0, 0.0)
    yaw_deg: float = 0.0
    colour: tuple[float, float, float] = (0.6, 0.45, 0.3)

    def __post_init__(self) -> None:
        """Check the kind and the numbers."""
        if not isinstance(self.kind, FurnitureKind):
            kinds = [kind.name for kind in FurnitureKind]
            raise ValueError(f"furniture {self.name!r}: kind={self.kind!r}; choices: {kinds}")
        if not all(math.isfinite(value) for value in (*self.position_m, self.yaw_deg)):
            raise ValueError(
                f"furniture {self.name!r}: position_m={tuple(self.position_m)}, "
                f"yaw_deg={self.yaw_deg} must be finite"
            )
        check_appearance(f"furniture {self.name!r}: ", self.colour, 0.0)


Colour = tuple[float, float, float]

_BOX, _CYLINDER = PropShape.box, PropShape.cylinder
_WHITE: Colour = (0.95, 0.95, 0.92)
_METAL: Colour = (0.25, 0.25, 0.27)


@dataclass(frozen=True)
class Part:
    """One primitive of a piece of furniture.

    Attributes:
        shape: Its shape.
        size_m: As in `PropCfg.size_m`.
        centre_m: Its centre in the frame of the piece.
        shade: Factor of the piece's colour.
        colour: Its own colour; None takes that of the piece.
    """

    shape: PropShape
    size_m: tuple[float, ...]
    centre_m: tuple[float, float, float]
    shade: float = 1.0
    colour: Colour | None = None


@dataclass(frozen=True)
class Piece:
    """The form of a kind of furniture.

    Attributes:
        width_m: Extent along its back.
        depth_m: Extent from its back to its front.
        parts: Its primitives.
    """

    width_m: float
    depth_m: float
    parts: tuple[Part, ...]


def _box(
    size_m: tuple[float, float, float],
    y: float = 0.0,
    foot_m: float = 0.0,
    *,
    x: float = 0.0,
    shade: float = 1.0,
    colour: Colour | None = None,
) -> Part:
    """Return a box with its lower face at the height `foot_m`."""
    return Part(_BOX, size_m, (x, y, foot_m + size_m[2] / 2.0), shade, colour)


def _post(
    radius_m: float,
    height_m: float,
    foot_m: float = 0.0,
    *,
    y: float = 0.0,
    shade: float = 1.0,
    colour: Colour | None = None,
) -> Part:
    """Return an upright cylinder with its lower face at the height `foot_m`."""
    centre = (0.0, y, foot_m + height_m / 2.0)
    return Part(_CYLINDER, (radius_m, height_m), centre, shade, colour)


def _block(width_m: float, depth_m: float, height_m: float, *more: Part) -> Piece:
    """Return a piece that is one box on the floor, with some parts on it."""
    return Piece(width_m, depth_m, (_box((width_m, depth_m, height_m)), *more))


FURNITURE: dict[FurnitureKind, Piece] = {
    FurnitureKind.armchair: _block(
        0.7, 0.7, 0.38, _box((0.7, 0.15, 0.4), -0.275, 0.38, shade=0.85)
    ),
    FurnitureKind.bathtub: _block(
        1.6, 0.7, 0.5, _box((1.4, 0.5, 0.02), 0.0, 0.5, colour=(0.6, 0.8, 0.9))
    ),
    FurnitureKind.bed: _block(
        1.9, 0.9, 0.45, _box((0.3, 0.6, 0.12), 0.0, 0.45, x=-0.75, colour=_WHITE)
    ),
    FurnitureKind.chair: Piece(
        0.4,
        0.4,
        (
            _box((0.3, 0.3, 0.4), shade=0.7),
            _box((0.4, 0.4, 0.05), 0.0, 0.4),
            _box((0.4, 0.05, 0.4), -0.175, 0.45),
        ),
    ),
    FurnitureKind.cot: _block(
        1.2,
        0.6,
        0.35,
        _box((0.04, 0.6, 0.4), 0.0, 0.35, x=-0.58, shade=0.8),
        _box((0.04, 0.6, 0.4), 0.0, 0.35, x=0.58, shade=0.8),
    ),
    FurnitureKind.counter: _block(1.6, 0.6, 0.85, _box((1.6, 0.6, 0.04), 0.0, 0.85, colour=_METAL)),
    FurnitureKind.desk: Piece(
        1.1,
        0.55,
        (
            _box((1.1, 0.55, 0.04), 0.0, 0.6),
            _box((0.04, 0.5, 0.6), x=-0.5, shade=0.75),
            _box((0.04, 0.5, 0.6), x=0.5, shade=0.75),
        ),
    ),
    FurnitureKind.dresser: _block(0.9, 0.45, 0.8),
    FurnitureKind.fridge: _block(0.6, 0.6, 1.7),
    FurnitureKind.lamp: Piece(
        0.36,
        0.36,
        (
            _post(0.03, 1.4, colour=_METAL),
            Part(PropShape.sphere, (0.18,), (0.0, 0.0, 1.5)),
        ),
    ),
    FurnitureKind.plant: Piece(
        0.4,
        0.4,
        (
            _post(0.15, 0.3),
            Part(
                PropShape.capsule,
                (0.2, 0.3),
                (0.0, 0.0, 0.65),
                colour=(0.2, 0.5, 0.2),
            ),
        ),
    ),
    FurnitureKind.shelf: Piece(
        1.2,
        0.3,
        (
            _box((1.2, 0.28, 1.4), -0.01),
            _box((1.0, 0.02, 0.25), 0.14, 0.85, colour=(0.7, 0.25, 0.2)),
            _box((1.0, 0.02, 0.25), 0.14, 0.4, colour=(0.25, 0.4, 0.6)),
        ),
    ),
    FurnitureKind.sofa: _block(1.6, 0.75, 0.4, _box((1.6, 0.2, 0.4), -0.275, 0.4, shade=0.85)),
    FurnitureKind.stool: Piece(0.32, 0.32, (_post(0.16, 0.3),)),
    FurnitureKind.table: Piece(
        1.2,
        0.8,
        (
            _box((1.2, 0.8, 0.04), 0.0, 0.66),
            _box((0.06, 0.7, 0.66), x=-0.5, shade=0.75),
            _box((0.06, 0.7, 0.66), x=0.5, shade=0.75),
        ),
    ),
    FurnitureKind.toilet: Piece(
        0.4,
        0.6,
        (
            _post(0.2, 0.38, y=0.1),
            _box((0.4, 0.2, 0.75), -0.2),
        ),
    ),
    FurnitureKind.toy_chest: _block(0.7, 0.4, 0.36, _box((0.7, 0.4, 0.04), 0.0, 0.36, shade=0.75)),
    FurnitureKind.tv_stand: _block(
        1.2, 0.4, 0.45, _box((0.9, 0.06, 0.5), -0.1, 0.45, colour=_METAL)
    ),
    FurnitureKind.wardrobe: _block(1.0, 0.55, 1.9),
    FurnitureKind.washbasin: Piece(
        0.5,
        0.4,
        (_post(0.09, 0.6), _box((0.5, 0.4, 0.15), 0.0, 0.6)),
    ),
}


def furniture_prop(cfg: FurnitureCfg) -> PropCfg:
    """Return the prop of a piece of furniture: one fixed compound of all its parts."""
    x, y = cfg.position_m
    return PropCfg(
        name=cfg.name,
        shape=PropShape.compound,
        position_m=(x, y, 0.0),
        yaw_deg=cfg.yaw_deg,
        colour=cfg.colour,
        parts=[_part(part, cfg.colour) for part in FURNITURE[cfg.kind].parts],
    )


def _part(part: Part, main: Colour) -> PartCfg:
    return PartCfg(part.shape, list(part.size_m), part.centre_m, colour=_colour(part, main))


def _colour(part: Part, main: Colour) -> Colour:
    if part.colour is not None:
        return part.colour
    red, green, blue = (part.shade * channel for channel in main)
    return red, green, blue


_TOLERANCE_M = 0.01  # of places that are given with two decimals
_KEPT_FREE_M = 0.1  # in front of the opening of a door, on both sides


def check_furniture(
    furniture: Sequence[FurnitureCfg],
    rooms: Sequence[RoomCfg],
    doors: Sequence[DoorCfg],
    *,
    walled: bool,
) -> None:
    """Check the places of furniture.

    Args:
        furniture: The pieces.
        rooms: The rooms of the house.
        doors: Its doors.
        walled: Whether walls are built round each room. Otherwise rooms may touch, and a piece may
            stand in several.

    Raises:
        ValueError: If a piece is not in a room, reaches into another one or stands in a door.
    """
    areas = {piece.name: footprints(furniture_prop(piece)) for piece in furniture}
    for piece in furniture:
        _check_in_room(piece, areas[piece.name], rooms, walled)
        for door in doors:
            _check_beside(piece, areas[piece.name], door, rooms)
    for one, other in combinations(furniture, 2):
        depth_m = _overlap_m(areas[one.name], areas[other.name])
        if depth_m > _TOLERANCE_M:
            raise ValueError(
                f"furniture {one.name!r} at position_m={tuple(one.position_m)} and {other.name!r} "
                f"at {tuple(other.position_m)} overlap by {depth_m:.2f} m; move one of them"
            )


def _check_in_room(
    piece: FurnitureCfg, areas: Sequence[Footprint], rooms: Sequence[RoomCfg], walled: bool
) -> None:
    points = [point for area in areas for point in (area.centre_m, *area.outline())]
    if walled:
        inside = any(all(_is_in(room, point) for point in points) for room in rooms)
    else:
        inside = all(any(_is_in(room, point) for room in rooms) for point in points)
    if inside:
        return
    nearest = min(rooms, key=lambda room: room.distance_m(piece.position_m))
    x, y, _ = nearest.lower_m
    raise ValueError(
        f"furniture {piece.name!r}: a {piece.kind.name} at position_m={tuple(piece.position_m)}, "
        f"yaw_deg={piece.yaw_deg:g} is not inside a room; the nearest one, {nearest.name!r}, "
        f"extends from {x:g} to {x + nearest.size_m[0]:g} m along x and from {y:g} to "
        f"{y + nearest.size_m[1]:g} m along y"
    )


def _check_beside(
    piece: FurnitureCfg, areas: Sequence[Footprint], door: DoorCfg, rooms: Sequence[RoomCfg]
) -> None:
    opening = _opening(door, rooms)
    if opening is not None and _overlap_m(areas, [opening]) > _TOLERANCE_M:
        raise ValueError(
            f"furniture {piece.name!r} at position_m={tuple(piece.position_m)} stands in the "
            f"opening of door {door.name!r} at {tuple(door.position_m)}, width_m={door.width_m:g}; "
            "move one of them"
        )


def _opening(door: DoorCfg, rooms: Sequence[RoomCfg]) -> Footprint | None:
    """Return the opening of a door with the floor that stays free in front of it.

    It is None between rooms of which one is above the other.
    """
    one, other = (next(room for room in rooms if room.name == name) for name in door.rooms)
    gaps_m = [max(_gap_m(one, other, axis), _gap_m(other, one, axis)) for axis in (0, 1)]
    axis = 0 if gaps_m[0] >= gaps_m[1] else 1
    if gaps_m[axis] < -_TOLERANCE_M:
        return None
    half_m = [door.width_m / 2.0, door.width_m / 2.0]
    half_m[axis] = gaps_m[axis] / 2.0 + _KEPT_FREE_M
    high_m = min(one.size_m[2], other.size_m[2])
    return Footprint(
        (door.position_m[0], door.position_m[1]), (half_m[0], half_m[1]), 0.0, 0.0, high_m
    )


def _gap_m(one: RoomCfg, other: RoomCfg, axis: int) -> float:
    """Return the distance along an axis from the end of one room to the beginning of another."""
    return other.lower_m[axis] - one.lower_m[axis] - one.size_m[axis]


def _overlap_m(areas: Sequence[Footprint], others: Sequence[Footprint]) -> float:
    return max(overlap_m(one, other) for one in areas for other in others)


def _is_in(room: RoomCfg, point: tuple[float, float]) -> bool:
    return room.distance_m(point) <= _TOLERANCE_M

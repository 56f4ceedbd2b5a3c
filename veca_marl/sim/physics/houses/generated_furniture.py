"""Furniture of generated houses: along the walls, so that paths and an open floor stay free."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.physics.houses.floor_division import FloorNeeds, FreeFloor, Rectangle
from veca_marl.sim.physics.houses.furniture import FURNITURE, FurnitureCfg, FurnitureKind
from veca_marl.sim.physics.houses.generated_doors import (
    floor_of,
    front,
    kept_free,
    open_leaf,
    overlap,
    turns_into,
)
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

Kind = FurnitureKind

USES: dict[str, tuple[FurnitureKind, ...]] = {
    "living": (Kind.sofa, Kind.tv_stand, Kind.armchair, Kind.shelf, Kind.plant, Kind.lamp),
    "kitchen": (Kind.counter, Kind.fridge, Kind.table, Kind.stool, Kind.plant),
    "bedroom": (Kind.bed, Kind.wardrobe, Kind.dresser, Kind.lamp, Kind.plant),
    "nursery": (Kind.cot, Kind.toy_chest, Kind.shelf, Kind.stool, Kind.lamp),
    "bathroom": (Kind.bathtub, Kind.washbasin, Kind.toilet, Kind.dresser),
    "study": (Kind.desk, Kind.shelf, Kind.armchair, Kind.plant, Kind.dresser),
    "dining": (Kind.table, Kind.dresser, Kind.chair, Kind.plant, Kind.lamp),
}
"""Uses of rooms and the furniture of each. The first room of a house is its living room."""

_TRIES = 12  # places that are drawn for a piece of furniture before it is left out
_CORNER = 0.5  # probability of a place in a corner


class _Side(NamedTuple):
    """A wall of a room: its axis, whether it is the upper one, and the yaw of furniture there."""

    axis: int
    upper: bool
    yaw_deg: float


_X_SIDES = (_Side(0, False, -90.0), _Side(0, True, 90.0))
_Y_SIDES = (_Side(1, False, 0.0), _Side(1, True, 180.0))


class RoomFurnishing:
    """Furniture of one room.

    Args:
        room: The room.
        doors: The doors of the house.
        needs: What stays free.
        sides_free: Whether the two walls of constant y stay free, so that balls can roll out of
            them.
    """

    def __init__(
        self, room: RoomCfg, doors: Sequence[DoorCfg], needs: FloorNeeds, sides_free: bool
    ) -> None:
        self._room, self._needs = room, needs
        self._floor = floor_of(room)
        own = [door for door in doors if room.name in door.rooms]
        self._kept_free = [kept_free(self._floor, door) for door in own]
        self._fronts = [front(self._floor, door) for door in own]
        self._leaves = [
            open_leaf(self._floor, door) for door in own if turns_into(self._floor, door)
        ]
        self._sides = _X_SIDES if sides_free else (*_X_SIDES, *_Y_SIDES)
        self._taken: list[Rectangle] = []

    def add(
        self,
        name: str,
        kind: FurnitureKind,
        colour: tuple[float, float, float],
        rng: np.random.Generator,
    ) -> FurnitureCfg | None:
        """Place a piece of furniture; return None if no place that was drawn is free."""
        for _ in range(_TRIES):
            side = self._sides[int(rng.integers(len(self._sides)))]
            area = self._along(side, kind, rng)
            if area is not None and self._is_free(area):
                self._taken.append(area)
                x, y = (low + size / 2.0 for low, size in zip(*area, strict=True))
                return FurnitureCfg(name, kind, (round(x, 4), round(y, 4)), side.yaw_deg, colour)
        return None

    def _along(
        self, side: _Side, kind: FurnitureKind, rng: np.random.Generator
    ) -> Rectangle | None:
        """Draw a place along a wall; return None if the piece is longer than the wall."""
        piece, axis = FURNITURE[kind], side.axis
        spare_m = self._floor.size_m[1 - axis] - piece.width_m
        if spare_m < 0.0 or piece.depth_m > self._floor.size_m[axis]:
            return None
        shift_m = round(float(rng.uniform(0.0, spare_m)), 2)
        if rng.random() < _CORNER:
            shift_m = 0.0 if rng.random() < 0.5 else spare_m
        lower, size = list(self._floor.lower_m), [piece.width_m, piece.width_m]
        lower[1 - axis] += shift_m
        if side.upper:
            lower[axis] += self._floor.size_m[axis] - piece.depth_m
        size[axis] = piece.depth_m
        return Rectangle((lower[0], lower[1]), (size[0], size[1]))

    def _is_free(self, area: Rectangle) -> bool:
        """Return whether a piece of furniture may stand there."""
        if any(overlap(area, other) for other in (*self._taken, *self._kept_free)):
            return False
        floor = FreeFloor(self._floor, [*self._leaves, *self._taken, area])
        return self._needs.are_met(floor, self._fronts)


def uses_of(count: int, rng: np.random.Generator) -> list[str]:
    """Draw a use for each room, the living room first; uses repeat when all occur."""
    others = [use for use in USES if use != "living"]
    drawn = ["living"]
    while len(drawn) < count:
        drawn += [others[int(number)] for number in rng.permutation(len(others))]
    return drawn[:count]


def furnish(
    room: RoomCfg,
    use: str,
    furnishing: RoomFurnishing,
    count: int,
    rng: np.random.Generator,
) -> list[FurnitureCfg]:
    """Place up to `count` different pieces of furniture that fit the use of a room."""
    kinds = USES[use]
    pieces = []
    for number in rng.permutation(len(kinds))[:count]:
        kind = kinds[int(number)]
        colour = _colour(rng)
        piece = furnishing.add(f"{room.name}_{kind.name}", kind, colour, rng)
        if piece is not None:
            pieces.append(piece)
    return pieces


def _colour(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a colour that is more saturated than those of walls."""
    hue, saturation, value = rng.uniform((0.0, 0.5, 0.4), (1.0, 0.8, 0.9)).tolist()
    red, green, blue = (round(each, 3) for each in colorsys.hsv_to_rgb(hue, saturation, value))
    return red, green, blue

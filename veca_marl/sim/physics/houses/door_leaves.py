"""Leaves of the doors in built walls, and checks that they can slide or turn."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

from veca_marl.sim.physics.houses.footprints import Footprint, footprints, overlap_m, own_footprints
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.physics.props.doors import (
    LEAF_M,
    LEAF_WALL_M,
    door_leaf,
    open_reach_m,
    sliding_leaf,
)
from veca_marl.sim.physics.props.joint import JointKind, LockCfg
from veca_marl.sim.physics.rooms import DoorCfg, LeafCfg

_TOLERANCE_M = 1e-6
_CLEARANCE_M = 0.005  # from the open leaf to what it must not touch


class WallWithDoors(NamedTuple):
    """A straight wall as it is built.

    Attributes:
        axis: 0 for a wall in a plane of constant x, 1 for one of constant y.
        doors: The doors in it.
        pieces: The props that it consists of.
    """

    axis: int
    doors: Sequence[DoorCfg]
    pieces: Sequence[PropCfg]


def leaf_name(door: DoorCfg) -> str:
    """Return the name of the prop that is the leaf of a door."""
    return f"leaf_{door.name}"


def leaf_props(
    wall: WallWithDoors, walls: Iterable[WallWithDoors], height_m: float
) -> list[PropCfg]:
    """Return the leaves of the doors in a wall.

    Args:
        wall: The wall.
        walls: All walls of the house.
        height_m: Height of the openings.

    Raises:
        ValueError: If the wall beside a door cannot take the leaf that slides into it.
    """
    others = [piece for one in walls if one is not wall for piece in one.pieces]
    leaves = []
    for door in wall.doors:
        if door.leaf is not None:
            leaves.append(_leaf(door, door.leaf, wall, others, height_m))
    _check_apart(wall)
    return leaves


def _leaf(
    door: DoorCfg,
    leaf: LeafCfg,
    wall: WallWithDoors,
    others: Sequence[PropCfg],
    height_m: float,
) -> PropCfg:
    """Return the leaf of a door; the opening of a wall of constant x leads along x."""
    place = (leaf_name(door), door.position_m, 0.0 if wall.axis == 0 else 90.0)
    lock = LockCfg(leaf.key, leaf.locked) if leaf.key or leaf.locked else None
    _check_thickness(door, wall)
    if leaf.kind is JointKind.hinge:
        prop = door_leaf(
            *place,
            door.width_m,
            height_m,
            opens_to_front=leaf.opens_to_front,
            lock=lock,
            colour=leaf.colour,
        )
    else:
        _check_slide(door, leaf, wall, others)
        prop = sliding_leaf(
            *place,
            door.width_m,
            height_m,
            wall=_piece_beside(door, leaf.opens_to_front, wall).name,
            # +y of the leaf is +y of the house in a wall of constant x, and -x in one of constant y
            slides_to_left=leaf.opens_to_front == (wall.axis == 0),
            lock=lock,
            colour=leaf.colour,
        )
    assert prop.joint is not None
    return replace(prop, joint=replace(prop.joint, opening=leaf.opening))


def _check_thickness(door: DoorCfg, wall: WallWithDoors) -> None:
    """Check that a closed leaf is inside its wall, as walls and sound take it.

    Raises:
        ValueError: If the wall is too thin.
    """
    thickness_m = wall.pieces[0].size_m[wall.axis]
    if thickness_m < LEAF_WALL_M:
        raise ValueError(
            f"door {door.name!r}: walls.thickness_m={thickness_m} is too thin for a leaf of "
            f"{LEAF_M} m; choose at least {LEAF_WALL_M} or a door without a leaf"
        )


def _check_slide(
    door: DoorCfg, leaf: LeafCfg, wall: WallWithDoors, others: Sequence[PropCfg]
) -> None:
    """Check that the leaf of a door can slide to its side.

    Raises:
        ValueError: If it cannot; the message names the choices.
    """
    front = leaf.opens_to_front
    fault = _hindrance(door, front, wall, others)
    if fault:
        choices = "a narrower door or leaf.kind=hinge"
        if not _hindrance(door, not front, wall, others):
            choices = f"leaf.opens_to_front={str(not front).lower()}, {choices}"
        raise ValueError(
            f"door {door.name!r}: its leaf of {door.width_m} m slides into the wall beside it, "
            f"{fault}; choose {choices}"
        )


def _hindrance(door: DoorCfg, front: bool, wall: WallWithDoors, others: Sequence[PropCfg]) -> str:
    """Return what keeps the leaf of a door from sliding to a side; empty if nothing does."""
    along, across = 1 - wall.axis, wall.axis
    piece = _piece_beside(door, front, wall)
    if piece.size_m[along] < door.width_m:
        return f"which is {piece.size_m[along]:.2f} m long"
    begin, end = _extent(door, front, wall.axis)
    half_m = LEAF_M / 2.0 + _CLEARANCE_M
    at_m = door.position_m[across]
    for other in others:
        low, high = _sides(other, along)
        near, far = _sides(other, across)
        meets = low < end + _CLEARANCE_M and high > begin - _CLEARANCE_M
        if meets and near < at_m + half_m and far > at_m - half_m and other.position_m[2] == 0.0:
            free_m = low - begin if front else end - high
            return f"where {other.name!r} meets it after {max(free_m, 0.0):.2f} m"
    return ""


def _check_apart(wall: WallWithDoors) -> None:
    """Check that no two leaves slide to the same place in a wall."""
    sliding = [
        (door, door.leaf.opens_to_front)
        for door in wall.doors
        if door.leaf is not None and door.leaf.kind is JointKind.slide
    ]
    for (one, to_front), (other, other_to_front) in combinations(sliding, 2):
        begin, end = _extent(one, to_front, wall.axis)
        other_begin, other_end = _extent(other, other_to_front, wall.axis)
        if begin < other_end + _CLEARANCE_M and other_begin < end + _CLEARANCE_M:
            raise ValueError(
                f"doors {one.name!r} and {other.name!r}: their leaves slide to the same place in "
                "the wall between them; choose leaf.opens_to_front, a narrower door or "
                "leaf.kind=hinge for one of them"
            )


def _extent(door: DoorCfg, front: bool, axis: int) -> tuple[float, float]:
    """Return where the open leaf of a door begins and ends in the wall beside it, metres."""
    edge = _edge(door, front, axis)
    reach_m = open_reach_m(door.width_m)
    return (edge, edge + reach_m) if front else (edge - reach_m, edge)


def _piece_beside(door: DoorCfg, front: bool, wall: WallWithDoors) -> PropCfg:
    """Return the piece of a wall on one side of a door."""
    along = 1 - wall.axis
    edge = _edge(door, front, wall.axis)
    return next(
        piece
        for piece in wall.pieces
        if piece.position_m[2] == 0.0  # not above a door
        and abs(_sides(piece, along)[0 if front else 1] - edge) < _TOLERANCE_M
    )


def _edge(door: DoorCfg, front: bool, axis: int) -> float:
    """Return the coordinate of the edge of an opening along its wall, metres."""
    return door.position_m[1 - axis] + (0.5 if front else -0.5) * door.width_m


def _sides(piece: PropCfg, axis: int) -> tuple[float, float]:
    """Return the least and the greatest coordinate of a wall along an axis, metres."""
    half = piece.size_m[axis] / 2.0
    return piece.position_m[axis] - half, piece.position_m[axis] + half


_SWING_TOLERANCE_M = 0.001
_STEP_DEG = 3.0  # between the angles that are tried


class Hindrance(NamedTuple):
    """What a leaf meets, and after how many degrees.

    Attributes:
        thing: A wall or a piece of furniture.
        after_deg: How far the leaf has turned then.
    """

    thing: PropCfg
    after_deg: float


def check_swings(
    doors: Sequence[DoorCfg], leaves: Sequence[PropCfg], things: Sequence[PropCfg]
) -> None:
    """Check that hinged leaves with their handles meet nothing until they are open.

    Args:
        doors: Doors with leaves.
        leaves: The leaf of each.
        things: Walls and furniture.

    Raises:
        ValueError: If one does; the message names the choices.
    """
    for door, leaf in zip(doors, leaves, strict=True):
        assert door.leaf is not None
        if door.leaf.kind is not JointKind.hinge:
            continue
        met = first_met(leaf, things)
        if met is None:
            continue
        name, moves = met.thing.name, "move the door"
        if met.thing.shape is not PropShape.wall:
            moves += f" or {name!r}"
        if first_met(_opening_to_other_side(leaf), things) is None:
            other = str(not door.leaf.opens_to_front).lower()
            moves = f"choose leaf.opens_to_front={other}, or {moves}"
        raise ValueError(
            f"door {door.name!r}: its leaf of {door.width_m:g} m meets {name!r} after "
            f"{met.after_deg:.0f} of {_range_deg(leaf):.0f} degrees; {moves}"
        )


def first_met(leaf: PropCfg, things: Sequence[PropCfg]) -> Hindrance | None:
    """Return what a hinged leaf meets first on its way from closed to open; None if nothing.

    Args:
        leaf: The prop of the leaf.
        things: Walls and furniture.
    """
    swept = _turned(leaf, 0.0)
    x, y = _hinge(leaf)
    reach_m = max(
        math.hypot(part.centre_m[0] - x, part.centre_m[1] - y) + part.reach_m for part in swept
    )
    near = [
        (thing, area)
        for thing in things
        for area in footprints(thing)
        if area.distance_m((x, y)) < reach_m
    ]
    steps = math.ceil(_range_deg(leaf) / _STEP_DEG)
    for step in range(steps + 1):
        angle_deg = _range_deg(leaf) * step / steps
        parts = _turned(leaf, angle_deg)
        for thing, area in near:
            if any(overlap_m(part, area) > _SWING_TOLERANCE_M for part in parts):
                return Hindrance(thing, angle_deg)
    return None


def open_footprints(leaf: PropCfg) -> list[Footprint]:
    """Return the footprints of a hinged leaf and its handles while it is open."""
    return _turned(leaf, _range_deg(leaf))


def _turned(leaf: PropCfg, angle_deg: float) -> list[Footprint]:
    """Return the footprints of a leaf that has turned by an angle."""
    assert leaf.joint is not None
    x, y, _ = leaf.joint.anchor_m
    turn_rad = math.copysign(math.radians(angle_deg), leaf.joint.axis[2])
    place, yaw_rad = (leaf.position_m[0], leaf.position_m[1]), math.radians(leaf.yaw_deg)
    return [
        part.moved((-x, -y), 0.0).moved((x, y), turn_rad).moved(place, yaw_rad)
        for part in own_footprints(leaf, leaf.position_m[2])
    ]


def _hinge(leaf: PropCfg) -> tuple[float, float]:
    """Return the place of the hinge of a leaf on the floor plan, metres."""
    assert leaf.joint is not None
    x, y, _ = leaf.joint.anchor_m
    yaw_rad = math.radians(leaf.yaw_deg)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return leaf.position_m[0] + cos * x - sin * y, leaf.position_m[1] + sin * x + cos * y


def _range_deg(leaf: PropCfg) -> float:
    assert leaf.joint is not None
    return leaf.joint.range_deg


def _opening_to_other_side(leaf: PropCfg) -> PropCfg:
    """Return a leaf with its hinge in the other face, as `door_leaf` makes it."""
    assert leaf.joint is not None
    x, y, z = leaf.joint.anchor_m
    up = leaf.joint.axis[2]
    return replace(leaf, joint=replace(leaf.joint, anchor_m=(-x, y, z), axis=(0.0, 0.0, -up)))

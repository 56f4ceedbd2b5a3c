"""Leaves of the doors in built walls, and which walls a sliding leaf can move into."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

from veca_marl.sim.physics.props import PropCfg
from veca_marl.sim.physics.props.doors import (
    LEAF_M,
    LEAF_WALL_M,
    door_leaf,
    open_reach_m,
    sliding_leaf,
)
from veca_marl.sim.physics.props.joint_cfg import JointKind, LockCfg
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

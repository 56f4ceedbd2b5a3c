"""A check that the hinged leaves of doors can turn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from veca_marl.sim.physics.houses.footprints import (
    Footprint,
    footprints,
    overlap_m,
    own_footprints,
)
from veca_marl.sim.physics.props import JointKind, PropCfg, PropShape
from veca_marl.sim.physics.rooms import DoorCfg

_TOLERANCE_M = 0.001
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
            if any(overlap_m(part, area) > _TOLERANCE_M for part in parts):
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

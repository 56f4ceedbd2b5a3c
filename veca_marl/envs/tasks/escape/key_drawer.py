"""A cupboard with a drawer in which a key lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.sim.geometry import Floats, rotation_about_vertical
from veca_marl.sim.physics import PlannedProp, Prop, PropCfg, RoomCfg, StandingProp, World
from veca_marl.sim.physics.props.containers import cupboard_with_drawer
from veca_marl.sim.physics.props.toys import key
from veca_marl.sim.sound import SoundCfg

_DEPTH_M, _WIDTH_M, _HEIGHT_M = 0.4, 0.45, 0.5
_WALL_GAP_M = 0.02
_CORNER_M = 0.6  # from the middle of the cupboard
_FRONT_M = 0.8  # floor in front of the middle that stays free
_CLEAR_M = 0.4  # from furniture
_KEY_BEHIND_M = 0.03  # the middle of the cupboard: above it the open drawer does not hide the key
_DRAWS = 1000


class KeyDrawer(NamedTuple):
    """The props.

    Attributes:
        cupboard: The fixed part.
        drawer: Slides out of it, to the x axis of both frames.
        key: Lies in the drawer.
    """

    cupboard: Prop
    drawer: Prop
    key: Prop

    def place(self, place: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, with the key in the drawer."""
        x, y, z = place
        for prop in (self.cupboard, self.drawer):
            prop.place((x, y, z + prop.cfg.position_m[2]), yaw_rad)
        floor = self.drawer.cfg.parts[0]
        height_m = self.drawer.cfg.position_m[2] + floor.position_m[2] + floor.size_m[2] / 2.0
        behind = rotation_about_vertical(yaw_rad)[:, 0] * _KEY_BEHIND_M
        lying_m = z + height_m + self.key.cfg.position_m[2]
        self.key.place((x - behind[0], y - behind[1], lying_m), yaw_rad + math.pi / 2.0)


def add_key_drawer(world: World, key_sound: SoundCfg) -> KeyDrawer:
    """Add a cupboard with a drawer that opens, and a key, to a world that is not frozen yet."""
    case, drawer = _cupboard()
    return KeyDrawer(
        world.add_prop(case),
        world.add_prop(drawer),
        world.add_prop(replace(key("key", (0.0, 0.0)), sound=key_sound)),
    )


def planned_cupboard() -> PlannedProp:
    """Return the cupboard of `add_key_drawer` without a world, for trials of its placement."""
    return PlannedProp(_cupboard()[0])


def _cupboard() -> list[PropCfg]:
    size_m = (_DEPTH_M, _WIDTH_M, _HEIGHT_M)
    return cupboard_with_drawer("cupboard", (0.0, 0.0), size_m=size_m)


def draw_place_at_wall(
    room: RoomCfg,
    furniture: Sequence[StandingProp],
    avoided: Floats,
    apart_m: float,
    rng: np.random.Generator,
) -> tuple[Floats, float]:
    """Draw a place of the cupboard with its back to a wall of a room.

    Args:
        room: The room.
        furniture: Props to keep away from, with the floor in front as well.
        avoided: ``(2,)`` metres: the middle of a door.
        apart_m: Least distance from it.
        rng: Random generator of the episode.

    Returns:
        The point ``(3,)`` of the floor, metres, and the yaw.

    Raises:
        ValueError: If none of 1000 draws fits, or a wall is too short for the cupboard.
    """
    is_wide = min(room.size_m[:2]) >= 2.0 * _CORNER_M
    for _ in range(_DRAWS if is_wide else 0):
        place, yaw_rad = _random_place(room, rng)
        front = place + _FRONT_M * rotation_about_vertical(yaw_rad)[:, 0]
        ends = np.array([place[:2], front[:2]])
        far = math.dist(place[:2], avoided) >= apart_m
        if far and all((clearances_m(prop, ends) >= _CLEAR_M).all() for prop in furniture):
            return place, yaw_rad
    raise ValueError(
        f"room {room.name!r} of {room.extent} leaves no place for a cupboard at a wall, "
        f"{_CORNER_M} m from the corners and {apart_m} m from the door"
    )


def _random_place(room: RoomCfg, rng: np.random.Generator) -> tuple[Floats, float]:
    """Draw a wall and a place along it; return the point of the floor and the yaw into the room."""
    axis, far = int(rng.integers(2)), bool(rng.integers(2))
    low, size = np.array(room.lower_m), np.array(room.size_m)
    inset_m = _WALL_GAP_M + _DEPTH_M / 2.0
    place = low.copy()
    place[axis] += size[axis] - inset_m if far else inset_m
    place[1 - axis] += rng.uniform(_CORNER_M, size[1 - axis] - _CORNER_M)
    return place, math.pi * (0.5 * axis + (1.0 if far else 0.0))

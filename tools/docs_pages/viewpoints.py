"""Where the camera of a task's picture is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.babyzumas_revenge import BabyzumasRevenge
from veca_marl.envs.tasks.navigation.object_nav import ObjectNav
from veca_marl.envs.tasks.push_out import PushOut
from veca_marl.envs.tasks.soccer import Soccer
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import RoomCfg
from veca_marl.sim.vision import look_at

FOV_DEG = 48.0
_ASPECT = 1.6
_USED = 0.85  # share of the picture for what is framed
_ABOVE_FLOOR = np.array([0.0, 0.0, 0.1])
_HEAD = np.array([0.0, 0.0, 0.5])
_TO_WALL_M = 0.2
_ASIDE_RAD = math.radians(35.0)  # of the camera from the line behind an agent
_ELEVATION_RAD = math.radians(40.0)

Viewpoint = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Where a camera is, and what it looks at, metres."""


def viewpoint(game: Game) -> Viewpoint:
    """Return the viewpoint of a task's picture.

    An agent and what it has to go to are framed. Otherwise the camera is near a joint-level body
    except in games on a whole floor, above a house of several rooms, or in a corner of the room.
    """
    task, first = game.task, game.players[0].body
    if isinstance(task, ObjectNav):
        return _framed(game, [prop.position for prop in (task.target, *task.wrong)])
    if isinstance(task, BabyzumasRevenge):
        return _framed(game, [task.cupboard.position, task.door.position])
    if not isinstance(first, Walker) and not isinstance(task, Soccer | PushOut):
        target = np.array([*first.position[:2], 0.15])
        return target + first.forward * 1.0 + np.array([0.5, 0.9, 0.85]), target
    rooms = game.cfg.playground.rooms
    return _above_house(rooms) if len(rooms) > 1 else _from_corner(game)


def _above_house(rooms: list[RoomCfg]) -> Viewpoint:
    corners = np.array([room.lower_m for room in rooms])
    centre = (corners.min(0) + (corners + [room.size_m for room in rooms]).max(0)) / 2.0
    return centre + np.array([-0.1, -6.0, 11.0]), centre


def _from_corner(game: Game) -> Viewpoint:
    room = _room(game)
    low, size = np.array(room.lower_m), np.array(room.size_m)
    seen = [p.body.position for p in game.players if room.contains(p.body.position + _ABOVE_FLOOR)]
    centre = low + size * (0.5, 0.5, 0.0)
    return low + size * (0.06, 0.06, 0.85), 0.4 * centre + 0.6 * np.mean(seen, axis=0)


def _framed(game: Game, things: list[Floats]) -> Viewpoint:
    """Look over an agent at some things, from as near as all of them are in the picture."""
    body, room = game.players[0].body, _room(game)
    points = np.array([body.position, body.position + _HEAD, *things])
    target = (points.min(axis=0) + points.max(axis=0)) / 2.0
    x, y = np.mean(things, axis=0)[:2] - body.position[:2]
    yaw = math.atan2(y, x) + math.pi + _ASIDE_RAD
    level = math.cos(_ELEVATION_RAD)
    back = np.array([level * math.cos(yaw), level * math.sin(yaw), math.sin(_ELEVATION_RAD)])
    eye = target + back * _distance_m(points - target, back)
    low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
    eye[:2] = np.clip(eye[:2], low + _TO_WALL_M, low + size - _TO_WALL_M)
    return eye, target


def _distance_m(offsets: Floats, back: Floats) -> float:
    """Return the least distance from which a camera has all points in its picture.

    Args:
        offsets: Points from the one that it looks at, ``(n, 3)`` metres.
        back: Unit vector from there to the camera, ``(3,)``.
    """
    forward, left, up = look_at(back, np.zeros(3)).rotation.T
    half = _USED * math.tan(math.radians(FOV_DEG) / 2.0)
    needed = np.maximum(np.abs(offsets @ left) / (half * _ASPECT), np.abs(offsets @ up) / half)
    return float((needed - offsets @ forward).max())


def _room(game: Game) -> RoomCfg:
    """Return the room of the first agent."""
    place = game.players[0].body.position + _ABOVE_FLOOR
    return next(room for room in game.cfg.playground.rooms if room.contains(place))

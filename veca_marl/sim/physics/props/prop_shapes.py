"""The primitives that props are made of, and which props stop sound."""

from __future__ import annotations

from typing import Any

import numpy as np

from veca_marl.sim.geometry import Geom, Shape
from veca_marl.sim.physics.props.prop_cfg import PropCfg, PropShape

SOUND_OBSTACLE_M = (0.7, 1.0)
"""Least width and height of a box that attenuates sound as a wall does. Sound below 340 Hz, with
wavelengths above a metre, is diffracted round anything smaller."""


def prop_geoms(cfg: PropCfg) -> tuple[Geom, ...]:
    """Return the primitives of a prop in its own frame."""
    size = tuple(cfg.size_m)
    surface: dict[str, Any] = {
        "colour": tuple(cfg.colour),
        "checker_m": cfg.checker_m,
        "transparent": cfg.transparent,
        "tangible": cfg.tangible,
    }
    match cfg.shape:
        case PropShape.sphere:
            return (Geom(Shape.SPHERE, size, **surface),)
        case PropShape.box:
            return (Geom(Shape.BOX, tuple(s / 2 for s in size), **surface),)
        case PropShape.cylinder:
            return (Geom(Shape.CYLINDER, size, **surface),)
        case PropShape.capsule:
            return (Geom(Shape.CAPSULE, size, **surface),)
        case PropShape.wall:
            half = tuple(s / 2 for s in size)
            return (Geom(Shape.BOX, half, offset=(0.0, 0.0, half[2]), **surface),)
        case PropShape.goal:
            return _goal_geoms(size, surface)


def stops_sound(cfg: PropCfg) -> bool:
    """Return whether a prop attenuates sound between rooms: a wall or a large box, such as a door.

    See `SOUND_OBSTACLE_M`.
    """
    if cfg.shape is not PropShape.box:
        return cfg.tangible and cfg.shape is PropShape.wall
    length_x, length_y, height = cfg.size_m
    width_m, height_m = SOUND_OBSTACLE_M
    return cfg.tangible and max(length_x, length_y) >= width_m and height >= height_m


def _goal_geoms(size: tuple[float, ...], surface: dict[str, Any]) -> tuple[Geom, ...]:
    """Two posts and a bar; the opening of the goal faces x, its width lies along y."""
    width, height, radius = size
    posts = [
        Geom(
            Shape.CYLINDER, (radius, height), offset=(0.0, side * width / 2, height / 2), **surface
        )
        for side in (-1.0, 1.0)
    ]
    along_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    bar = Geom(
        Shape.CYLINDER, (radius, width), offset=(0.0, 0.0, height), rotation=along_y, **surface
    )
    return (*posts, bar)

"""Furniture built of boxes, cylinders, spheres and capsules.

Sizes are those of common household furniture. Each piece is described in its own frame: x along its
back, y from the back to the front, z up, with the origin in the middle of its floor area.
"""

from __future__ import annotations

from dataclasses import dataclass

from veca_marl.sim.physics.houses.furniture_cfg import FurnitureCfg, FurnitureKind
from veca_marl.sim.physics.props import PartCfg, PropCfg, PropShape

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

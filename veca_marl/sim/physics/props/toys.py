"""Toys to sort, pieces of a disc, and keys."""

from __future__ import annotations

import math
from enum import Enum

from veca_marl.sim.physics.props.prop_cfg import PartCfg, PropCfg, PropShape

Colour = tuple[float, float, float]


class ToyKind(Enum):
    """The shapes of the paper's sorting task (ShapeSort)."""

    sphere = "sphere"
    cube = "cube"
    pyramid = "pyramid"
    cylinder = "cylinder"
    doll = "doll"


_SHAPES: dict[ToyKind, tuple[PropShape, tuple[float, ...]]] = {
    ToyKind.sphere: (PropShape.sphere, (0.5,)),
    ToyKind.cube: (PropShape.box, (1.0, 1.0, 1.0)),
    ToyKind.pyramid: (PropShape.pyramid, (1.0, 1.0, 1.0)),
    ToyKind.cylinder: (PropShape.cylinder, (0.5, 1.0)),
    ToyKind.doll: (PropShape.doll, (1.6,)),
}
"""Shape and size of each kind, in widths."""


def toy(
    name: str,
    kind: ToyKind,
    position_m: tuple[float, float],
    *,
    width_m: float = 0.12,
    mass_kg: float = 0.2,
    colour: Colour = (0.85, 0.2, 0.25),
) -> PropCfg:
    """Return a toy that stands on the floor.

    Args:
        name: Name of the prop.
        kind: Its shape.
        position_m: Where it stands.
        width_m: Its width; a doll is 1.6 times as high.
        mass_kg: Its mass.
        colour: Of all of it, except for head and hands of a doll.
    """
    shape, widths = _SHAPES[kind]
    height_m = width_m * (1.0 if kind is ToyKind.sphere else widths[-1])
    return PropCfg(
        name=name,
        shape=shape,
        size_m=[width_m * size for size in widths],
        position_m=(*position_m, height_m / 2.0),
        mass_kg=mass_kg,
        colour=colour,
        interactions=["grab"],
    )


def fraction_piece(
    name: str,
    fraction: float,
    position_m: tuple[float, float],
    *,
    radius_m: float = 0.2,
    height_m: float = 0.04,
    mass_kg: float = 0.2,
    colour: Colour = (0.2, 0.65, 0.6),
) -> PropCfg:
    """Return a fraction of a disc that lies on the floor, halved by the x axis of its frame.

    The origin of its frame is at the axis of the disc. A piece of more than a half is not convex
    and made of two.

    Args:
        name: Name of the prop.
        fraction: In (0, 1].
        position_m: The axis of the disc.
        radius_m: Radius of the disc.
        height_m: Its thickness.
        mass_kg: Mass of the whole disc; a piece has its share.
        colour: Of the piece.

    Raises:
        ValueError: If the fraction is not in (0, 1].
    """
    if not 0.0 < fraction <= 1.0:
        raise ValueError(f"piece {name!r}: fraction={fraction} is not in (0, 1]")
    angle = 360.0 * fraction
    return PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=(*position_m, height_m / 2.0),
        mass_kg=mass_kg * fraction,
        colour=colour,
        parts=_sectors(angle, radius_m, height_m),
        interactions=["grab"],
    )


def key(
    name: str,
    position_m: tuple[float, float],
    *,
    height_m: float = 0.0,
    length_m: float = 0.14,
    colour: Colour = (0.95, 0.8, 0.15),
) -> PropCfg:
    """Return a key that lies flat: a ring, a shaft and a bit; large enough to be seen.

    Args:
        name: Name of the prop, see `LockCfg.key`.
        position_m: Where it lies.
        height_m: Height of what it lies on, such as the floor of a drawer.
        length_m: Its length along x.
        colour: Of all of it.
    """
    thick = 0.14 * length_m
    ring = [0.22 * length_m, thick]
    parts = [
        PartCfg(PropShape.cylinder, ring, (-0.28 * length_m, 0.0, 0.0)),
        PartCfg(PropShape.box, [0.6 * length_m, 0.12 * length_m, thick], (0.2 * length_m, 0, 0)),
        PartCfg(
            PropShape.box,
            [0.12 * length_m, 0.2 * length_m, thick],
            (0.42 * length_m, -0.15 * length_m, 0.0),
        ),
    ]
    return PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=(*position_m, height_m + thick / 2.0),
        mass_kg=0.05,
        colour=colour,
        parts=parts,
        interactions=["grab"],
    )


def _sectors(angle_deg: float, radius_m: float, height_m: float) -> list[PartCfg]:
    """Return the fewest sectors of at most half a disc that make up an angle."""
    count = math.ceil(angle_deg / 180.0)
    each = angle_deg / count
    return [
        PartCfg(
            PropShape.sector,
            [radius_m, height_m],
            rotation_deg=(0.0, 0.0, each * (number - (count - 1) / 2.0)),
            angle_deg=each,
        )
        for number in range(count)
    ]

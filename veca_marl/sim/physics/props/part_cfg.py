"""Parts of compound props as data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from veca_marl.sim.physics.props.prop_shape import (
    PropShape,
    check_appearance,
    check_piece,
    check_shape,
)

SINGLE_SHAPES = (
    PropShape.sphere,
    PropShape.box,
    PropShape.cylinder,
    PropShape.capsule,
    PropShape.pyramid,
    PropShape.sector,
    PropShape.convex,
)
"""Shapes of one primitive each, which a compound can be made of."""


@dataclass
class PartCfg:
    """One part of a compound prop. All parts have the same density.

    Attributes:
        shape: One of `SINGLE_SHAPES`.
        size_m: Lengths in metres, see `SIZE_NAMES`.
        position_m: Centre of the part in the frame of the prop.
        rotation_deg: Rotations of the part about the x, y and z axis of the prop, one after the
            other.
        colour: Red, green, blue in [0, 1]; None is that of the prop.
        angle_deg: See `PropCfg.angle_deg`.
        points_m: See `PropCfg.points_m`.
    """

    shape: PropShape = PropShape.box
    size_m: list[float] = field(default_factory=list)
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: tuple[float, float, float] | None = None
    angle_deg: float = 90.0
    points_m: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_shape("part: ", self.shape, self.size_m)
        if self.shape not in SINGLE_SHAPES:
            names = [shape.name for shape in SINGLE_SHAPES]
            raise ValueError(f"part: shape={self.shape.name}; a part is one of {names}")
        check_piece("part: ", self)
        if not all(math.isfinite(value) for value in (*self.position_m, *self.rotation_deg)):
            raise ValueError(
                f"part: position_m={tuple(self.position_m)}, "
                f"rotation_deg={tuple(self.rotation_deg)} must be finite"
            )
        if self.colour is not None:
            check_appearance("part: ", self.colour, 0.0)

"""Furniture as data: which piece stands where."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.physics.props import check_appearance


class FurnitureKind(Enum):
    """Kinds of furniture, see `veca_marl.sim.physics.houses.furniture` for their sizes."""

    armchair = "armchair"
    bathtub = "bathtub"
    bed = "bed"
    chair = "chair"
    cot = "cot"
    counter = "counter"
    desk = "desk"
    dresser = "dresser"
    fridge = "fridge"
    lamp = "lamp"
    plant = "plant"
    shelf = "shelf"
    sofa = "sofa"
    stool = "stool"
    table = "table"
    toilet = "toilet"
    toy_chest = "toy_chest"
    tv_stand = "tv_stand"
    wardrobe = "wardrobe"
    washbasin = "washbasin"


@dataclass
class FurnitureCfg:
    """One piece of furniture, a fixed part of the world.

    Attributes:
        name: Unique in its playground.
        kind: What it is.
        position_m: The middle of its floor area, x and y.
        yaw_deg: Rotation about z. At 0 its back faces -y.
        colour: Red, green, blue in [0, 1] of its main part.
    """

    name: str = ""
    kind: FurnitureKind = FurnitureKind.table
    position_m: tuple[float, float] = (0.0, 0.0)
    yaw_deg: float = 0.0
    colour: tuple[float, float, float] = (0.6, 0.45, 0.3)

    def __post_init__(self) -> None:
        """Check the kind and the numbers."""
        if not isinstance(self.kind, FurnitureKind):
            kinds = [kind.name for kind in FurnitureKind]
            raise ValueError(f"furniture {self.name!r}: kind={self.kind!r}; choices: {kinds}")
        if not all(math.isfinite(value) for value in (*self.position_m, self.yaw_deg)):
            raise ValueError(
                f"furniture {self.name!r}: position_m={tuple(self.position_m)}, "
                f"yaw_deg={self.yaw_deg} must be finite"
            )
        check_appearance(f"furniture {self.name!r}: ", self.colour, 0.0)

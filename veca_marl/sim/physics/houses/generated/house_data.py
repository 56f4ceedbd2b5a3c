"""What a generator of houses returns."""

from __future__ import annotations

from typing import NamedTuple

from veca_marl.sim.physics.houses.furniture_cfg import FurnitureCfg
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg


class HouseData(NamedTuple):
    """A generated house.

    Attributes:
        rooms: The rooms, the living room first.
        doors: The doors between them.
        furniture: What stands in them, in the order in which it was placed.
    """

    rooms: list[RoomCfg]
    doors: list[DoorCfg]
    furniture: list[FurnitureCfg]

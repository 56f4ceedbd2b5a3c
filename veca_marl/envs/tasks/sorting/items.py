"""The toys that are sorted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.physics.props.toys import ToyKind, toy

Colour = tuple[float, float, float]

COLOURS: dict[str, Colour] = {
    "red": (0.9, 0.12, 0.1),
    "green": (0.1, 0.65, 0.2),
    "blue": (0.1, 0.25, 0.9),
    "yellow": (0.95, 0.85, 0.1),
}
"""Colours of toys and baskets."""

_ROW = 8  # things in a row in which they are built


class Item(NamedTuple):
    """A toy.

    Attributes:
        prop: The prop.
        kind: Its shape.
    """

    prop: Prop
    kind: ToyKind

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres."""
        place_on_floor(self.prop, floor, yaw_rad)

    def paint(self, world: World, colour: Colour) -> None:
        """Set the colour of all its parts until the next reset of the world."""
        world.scene.objects[self.prop.object_id].paint(colour)


def add_items(world: World, kinds: Sequence[ToyKind]) -> list[Item]:
    """Add toys that can be grabbed to a world that is not frozen yet, apart from each other."""
    return [
        Item(world.add_prop(toy(f"toy_{number}_{kind.name}", kind, built_at(number, 0.2))), kind)
        for number, kind in enumerate(kinds)
    ]


def built_at(number: int, spacing_m: float) -> tuple[float, float]:
    """Return a place ``(x, y)`` of a square grid beside the origin, metres."""
    return -2.0 + spacing_m * (number % _ROW), 1.0 + spacing_m * (number // _ROW)


def place_on_floor(prop: Prop, floor: Floats, yaw_rad: float) -> None:
    """Place a prop over a point ``(3,)`` of the floor, at the height of its configuration."""
    x, y, z = floor
    prop.place((x, y, z + prop.cfg.position_m[2]), yaw_rad)

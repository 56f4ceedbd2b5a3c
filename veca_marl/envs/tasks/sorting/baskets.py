"""The baskets into which toys are sorted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from veca_marl.envs.tasks.sorting.items import Colour, place_on_floor
from veca_marl.sim.geometry import Floats, rotation_about_vertical
from veca_marl.sim.physics import Prop, PropCfg, PropShape, World
from veca_marl.sim.physics.props.containers import basket
from veca_marl.sim.physics.props.toys import ToyKind, toy

_EDGE_M, _HEIGHT_M = 0.4, 0.15
_STAND_M = (0.16, 0.3)  # edge and height of the stand of a sample
_BEHIND_M = (_EDGE_M + _STAND_M[0]) / 2.0
_PILE_M = 0.4  # toys lie up to this height above the rim
_QUARTER_RAD = math.pi / 2.0
_STAND_COLOUR = (0.45, 0.35, 0.25)
_SAMPLE_COLOUR = (0.95, 0.95, 0.95)

REACH_M = math.hypot(_EDGE_M / 2.0 + _STAND_M[0], _EDGE_M / 2.0)
"""Radius of a circle about a basket with its stand."""


class Basket(NamedTuple):
    """An open box on the floor, into which toys are put with the verb `put_into`.

    Attributes:
        prop: The box.
        sign: A stand behind it with a sample of what it is for; may be empty.
    """

    prop: Prop
    sign: tuple[Prop, ...] = ()

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres, at the nearest multiple of 90 degrees."""
        yaw_rad = round(yaw_rad / _QUARTER_RAD) * _QUARTER_RAD
        place_on_floor(self.prop, floor, yaw_rad)
        behind = floor - _BEHIND_M * rotation_about_vertical(yaw_rad)[:, 0]
        for prop in self.sign:
            place_on_floor(prop, behind, yaw_rad)

    def contains(self, prop: Prop) -> bool:
        """Return whether the centre of a prop that no body holds is in the basket or above it."""
        if prop.holder is not None:
            return False
        x, y, z = self.prop.rotation.T @ (prop.position - self.prop.position)
        half_m = _EDGE_M / 2.0
        return bool(abs(x) <= half_m and abs(y) <= half_m and 0.0 <= z <= _HEIGHT_M + _PILE_M)


def add_coloured_basket(world: World, name: str, colour: Colour) -> Basket:
    """Add a basket of a colour to a world that is not frozen yet."""
    size_m = (_EDGE_M, _EDGE_M, _HEIGHT_M)
    return Basket(world.add_prop(basket(name, (0.0, 0.0), size_m=size_m, colour=colour)))


def add_basket_with_sample(world: World, name: str, kind: ToyKind, colour: Colour) -> Basket:
    """Add a basket with a white toy on a stand behind it to a world that is not frozen yet."""
    box = add_coloured_basket(world, name, colour)
    edge_m, height_m = _STAND_M
    stand = PropCfg(
        name=f"{name}.stand",
        shape=PropShape.box,
        size_m=[edge_m, edge_m, height_m],
        position_m=(0.0, 0.0, height_m / 2.0),
        colour=_STAND_COLOUR,
    )
    standing = toy(f"{name}.sample", kind, (0.0, 0.0), mass_kg=0.0, colour=_SAMPLE_COLOUR)
    x, y, z = standing.position_m
    sample = replace(standing, position_m=(x, y, z + height_m), interactions=[])
    return Basket(box.prop, (world.add_prop(stand), world.add_prop(sample)))

"""The objects of ObjectNav: kinds that differ in shape and colour."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlannedProp, Prop, PropCfg, PropShape, World


class ObjectKind(Enum):
    """Kinds of objects, each of one shape and colour.

    Attributes:
        doll: A child in violet clothes.
        ball: A red sphere.
        pyramid: A yellow pyramid.
        cube: A blue cube.
        cylinder: A green cylinder.
    """

    doll = "doll"
    ball = "ball"
    pyramid = "pyramid"
    cube = "cube"
    cylinder = "cylinder"


class _Look(NamedTuple):
    """Shape, size, height of the centre above the floor, and colour of a kind."""

    shape: PropShape
    size_m: tuple[float, ...]
    centre_m: float
    colour: tuple[float, float, float]


_LOOKS = {
    ObjectKind.doll: _Look(PropShape.doll, (0.36,), 0.18, (0.55, 0.2, 0.65)),
    ObjectKind.ball: _Look(PropShape.sphere, (0.15,), 0.15, (0.95, 0.15, 0.1)),
    ObjectKind.pyramid: _Look(PropShape.pyramid, (0.28, 0.28, 0.3), 0.15, (0.95, 0.8, 0.1)),
    ObjectKind.cube: _Look(PropShape.box, (0.25, 0.25, 0.25), 0.125, (0.1, 0.25, 0.9)),
    ObjectKind.cylinder: _Look(PropShape.cylinder, (0.12, 0.3), 0.15, (0.1, 0.7, 0.2)),
}


class SearchedObject(NamedTuple):
    """A fixed object of a kind.

    Attributes:
        prop: The prop.
        centre_m: Height of its centre when it stands on the floor.
    """

    prop: Prop
    centre_m: float

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres."""
        x, y, z = floor
        self.prop.place((x, y, z + self.centre_m), yaw_rad)


def add_object(world: World, name: str, kind: ObjectKind) -> SearchedObject:
    """Add a fixed object of a kind to a world that is not frozen yet."""
    return SearchedObject(world.add_prop(_prop_of(name, kind)), _LOOKS[kind].centre_m)


def radius_m(kind: ObjectKind) -> float:
    """Return the horizontal radius of the objects of a kind, see `Prop.radius_m`."""
    return PlannedProp(_prop_of(kind.name, kind)).radius_m


def _prop_of(name: str, kind: ObjectKind) -> PropCfg:
    look = _LOOKS[kind]
    return PropCfg(name=name, shape=look.shape, size_m=list(look.size_m), colour=look.colour)

"""Free floor of a playground as a fine grid, computed from its props, for tests of houses."""

import math

import numpy as np
from scipy import ndimage

from veca_marl.sim.physics import PropCfg, PropShape

CELL_M = 0.04
BODY_M = 0.78  # height below which props are in the way
RADIUS_M = 0.11
THICKEST_M = 0.5  # of walls
TIE_M = 1e-6  # a distance that is equal to the radius counts as enough, whatever its last digits


class FloorMap:
    """Cells in the centre of which a disc fits, in the rooms and in the openings of doors.

    Props that can move are not in the way; `also` are further fixed ones.
    """

    def __init__(self, playground, radius_m=RADIUS_M, also=()):
        low = np.min([room.lower_m[:2] for room in playground.rooms], axis=0)
        high = np.max([np.add(room.lower_m, room.size_m)[:2] for room in playground.rooms], axis=0)
        axes = [np.arange(a + CELL_M / 2, b, CELL_M) for a, b in zip(low, high, strict=True)]
        self.low, (self.x, self.y) = low, np.meshgrid(*axes, indexing="ij")
        self.free = np.zeros(self.x.shape, bool)
        for room in playground.rooms:
            self.free |= self.in_box(np.add(room.lower_m, room.size_m), room)
        for door in playground.doors:
            half = door.width_m / 2
            x, y = (
                abs(axis - at) for axis, at in zip((self.x, self.y), door.position_m, strict=True)
            )
            # one arm of this cross leads through the wall, the other one lies in it
            self.free |= (np.minimum(x, y) < half) & (np.maximum(x, y) < max(half, THICKEST_M / 2))
        for prop in pieces([*playground.built_props(), *also]):
            if is_in_the_way(prop):
                near = self.near(prop, radius_m)
                self.free[near] &= distance(prop, self.x[near], self.y[near]) >= radius_m - TIE_M
        self.labels, self.count = ndimage.label(self.free)

    def in_box(self, high, room):
        x, y, _ = room.lower_m
        return (self.x > x) & (self.x < high[0]) & (self.y > y) & (self.y < high[1])

    def near(self, prop, radius_m):
        """The cells that a prop can be nearer to than a radius, by the square round it."""
        reach_m = (
            radius_m
            + CELL_M
            + (
                math.hypot(*prop.size_m[:2]) / 2
                if prop.shape in (PropShape.wall, PropShape.box)
                else prop.size_m[0]
            )
        )
        ends = np.add.outer((-reach_m, reach_m), prop.position_m[:2]) - self.low
        (x, y), (end_x, end_y) = np.maximum(np.floor(ends / CELL_M).astype(int), 0)
        return slice(x, end_x + 1), slice(y, end_y + 1)

    def label(self, point):
        column, row = ((np.asarray(point)[:2] - self.low) / CELL_M).astype(int)
        return self.labels[column, row]


def pieces(props):
    """Yield the props, and the parts of compounds as props of their own."""
    for prop in props:
        if prop.shape is not PropShape.compound:
            yield prop
            continue
        c, s = math.cos(math.radians(prop.yaw_deg)), math.sin(math.radians(prop.yaw_deg))
        for number, part in enumerate(prop.parts):
            x, y, z = part.position_m
            place = np.add(prop.position_m, (c * x - s * y, s * x + c * y, z))
            yield PropCfg(
                f"{prop.name}.{number}",
                part.shape,
                part.size_m,
                tuple(place.tolist()),
                prop.yaw_deg,
                mass_kg=prop.mass_kg,
                colour=part.colour or prop.colour,
            )


def is_in_the_way(prop):
    return prop.tangible and prop.mass_kg == 0.0 and foot_m(prop) < BODY_M


def foot_m(prop):
    height = prop.position_m[2]
    if prop.shape is PropShape.wall:
        return height
    extent = {PropShape.sphere: 0, PropShape.box: 2, PropShape.cylinder: 1, PropShape.capsule: 1}
    size = prop.size_m[extent[prop.shape]]
    return height - (size if prop.shape is PropShape.sphere else size / 2)


def distance(prop, x, y):
    """Horizontal distance of points from a box or an upright cylinder; 0 inside."""
    x, y = x - prop.position_m[0], y - prop.position_m[1]
    if prop.shape not in (PropShape.wall, PropShape.box):
        return np.maximum(np.hypot(x, y) - prop.size_m[0], 0.0)
    c, s = math.cos(math.radians(prop.yaw_deg)), math.sin(math.radians(prop.yaw_deg))
    along, across = abs(c * x + s * y), abs(c * y - s * x)
    out = [
        np.maximum(each - size / 2, 0.0)
        for each, size in zip((along, across), prop.size_m, strict=False)
    ]
    return np.hypot(*out)

"""The areas that parts of walls, furniture and leaves cover on the floor plan."""

from __future__ import annotations

import math
from typing import NamedTuple

from veca_marl.sim.physics.props import PartCfg, PropCfg, PropShape

Point = tuple[float, float]

_ROUND = {PropShape.cylinder, PropShape.sphere, PropShape.capsule}


class Footprint(NamedTuple):
    """A rectangle on the floor plan that something covers between two heights.

    A round part counts with the square in its circle: what is taken to be covered is covered.

    Attributes:
        centre_m: Its middle, x and y.
        half_m: Half of its extents along its own axes.
        yaw_rad: Rotation of these axes.
        low_m: Height of its lower side.
        high_m: Height of its upper side.
        radius_m: Radius of a round part; 0 for others.
    """

    centre_m: Point
    half_m: Point
    yaw_rad: float
    low_m: float
    high_m: float
    radius_m: float = 0.0

    @property
    def axes(self) -> tuple[Point, Point]:
        """Unit vectors of its own axes."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (cos, sin), (-sin, cos)

    @property
    def reach_m(self) -> float:
        """Radius of the circle about its middle that contains it."""
        return max(self.radius_m, math.hypot(*self.half_m))

    def distance_m(self, point_m: Point) -> float:
        """Return the distance of a point on the floor plan; 0 inside."""
        offset = point_m[0] - self.centre_m[0], point_m[1] - self.centre_m[1]
        if self.radius_m:
            return max(math.hypot(*offset) - self.radius_m, 0.0)
        out = (
            max(abs(offset[0] * axis[0] + offset[1] * axis[1]) - half, 0.0)
            for axis, half in zip(self.axes, self.half_m, strict=True)
        )
        return math.hypot(*out)

    def outline(self) -> list[Point]:
        """Return its corners, or the extreme points of a circle along x and y."""
        x, y = self.centre_m
        if self.radius_m:
            offsets = ((self.radius_m, 0.0), (0.0, self.radius_m))
            return [(x + s * dx, y + s * dy) for dx, dy in offsets for s in (-1.0, 1.0)]
        (ux, uy), (vx, vy) = self.axes
        width, depth = self.half_m
        return [
            (x + a * width * ux + b * depth * vx, y + a * width * uy + b * depth * vy)
            for a in (-1.0, 1.0)
            for b in (-1.0, 1.0)
        ]

    def moved(self, centre_m: Point, yaw_rad: float) -> Footprint:
        """Return it with its frame at another place, turned by an angle."""
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y = self.centre_m
        place = centre_m[0] + cos * x - sin * y, centre_m[1] + sin * x + cos * y
        return self._replace(centre_m=place, yaw_rad=self.yaw_rad + yaw_rad)


def overlap_m(one: Footprint, other: Footprint) -> float:
    """Return how far one of two things has to be moved until they are apart; 0 if they are.

    They are moved on the floor plan, or to another height if that is shorter.
    """
    dx, dy = (b - a for a, b in zip(one.centre_m, other.centre_m, strict=True))
    depth_m = min(one.high_m, other.high_m) - max(one.low_m, other.low_m)
    depth_m = min(depth_m, one.reach_m + other.reach_m - math.hypot(dx, dy))
    if depth_m <= 0.0:  # most pairs: the axes are not needed
        return 0.0
    for axis in (*one.axes, *other.axes):
        if depth_m <= 0.0:
            return 0.0
        away_m = abs(dx * axis[0] + dy * axis[1])
        depth_m = min(depth_m, _half_along(one, axis) + _half_along(other, axis) - away_m)
    return max(depth_m, 0.0)


def footprints(prop: PropCfg) -> list[Footprint]:
    """Return the footprints of a wall, or of the parts of an upright compound, in the house."""
    yaw_rad = math.radians(prop.yaw_deg)
    x, y, z = prop.position_m
    return [part.moved((x, y), yaw_rad) for part in own_footprints(prop, z)]


def own_footprints(prop: PropCfg, foot_m: float) -> list[Footprint]:
    """Return the footprints of `footprints` in the frame of the prop, at a height of its origin."""
    if prop.shape is PropShape.wall:
        length, depth, height = prop.size_m
        return [
            Footprint((0.0, 0.0), (length / 2.0, depth / 2.0), 0.0, foot_m, foot_m + height),
        ]
    return [_of_part(part, foot_m) for part in prop.parts]


def _of_part(part: PartCfg, foot_m: float) -> Footprint:
    x, y, z = part.position_m
    size, middle = part.size_m, foot_m + z
    if part.shape not in _ROUND:
        half, up = (size[0] / 2.0, size[1] / 2.0), size[2] / 2.0
        return Footprint((x, y), half, 0.0, middle - up, middle + up)
    radius = size[0]
    up = {
        PropShape.sphere: radius,
        PropShape.capsule: radius + size[-1] / 2.0,
        PropShape.cylinder: size[-1] / 2.0,
    }[part.shape]
    side = radius / math.sqrt(2.0)
    return Footprint((x, y), (side, side), 0.0, middle - up, middle + up, radius)


def _half_along(footprint: Footprint, axis: Point) -> float:
    """Return half of the extent of a footprint along a direction."""
    return sum(
        half * abs(own[0] * axis[0] + own[1] * axis[1])
        for half, own in zip(footprint.half_m, footprint.axes, strict=True)
    )

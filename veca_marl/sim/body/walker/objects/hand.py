"""The right hand of a walker: it holds one light prop at the palm."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.interactions import Grip, free_path_m, surface_m

_COMPRESSION_M = 0.002  # of the palm's skin by the held prop, so that the palm feels it
_FLOOR_GAP_M = 0.01  # between the floor and the lowest point of a held prop
_WALL_GAP_M = 0.01  # between a wall and the surface of a held prop
_CLEARANCE_M = 1e-4  # from the surface of the walker's own capsule to the start of a ray


class Hand:
    """Holds a prop beside the palm, upright, at a constant yaw relative to the trunk.

    The prop is kinematic while it is held: its pose is set at each physics step. It does not
    collide with its holder. It stays on the walker's side of walls: where a wall is nearer than
    the hand would hold it, it is held nearer to the trunk.

    Args:
        client: PyBullet's client id.
        holder: Name of the walker.
        capsule_id: PyBullet's id of the walker's capsule.
        radius_m: Radius of the capsule.
    """

    def __init__(self, client: int, holder: str, capsule_id: int, radius_m: float) -> None:
        self._client, self._radius_m = client, radius_m
        self._grip = Grip(client, holder, [capsule_id])
        self._yaw_rad = 0.0
        self._half_width_m = self._below_m = 0.0
        self._offset: Floats = np.zeros(3)

    @property
    def prop(self) -> Prop | None:
        """The held prop; None if the hand is empty."""
        return self._grip.prop

    def take(self, prop: Prop, yaw_rad: float) -> None:
        """Hold a prop from now on; `follow` moves it to the palm.

        Args:
            prop: Any prop that is not held.
            yaw_rad: Heading of the walker.
        """
        yaw = prop.yaw_rad
        prop.carry(prop.position, yaw, (0.0, 0.0, 0.0))  # upright, as it is measured and held
        self._half_width_m = self._measured_half_width_m(prop, yaw_rad)
        self._below_m = float(prop.position[2]) - prop.lowest_m
        self._yaw_rad = yaw - yaw_rad
        self._grip.take(prop)

    def drop(self) -> None:
        """Hold nothing from now on; nothing is moved."""
        self._grip.drop()

    def set_palm(self, palm: Floats, ground: Floats, yaw_rad: float) -> None:
        """Compute where the prop is relative to the walker, from the present pose of the palm.

        Args:
            palm: ``(3,)`` metres, world frame: centre of the right palm, which faces to the left.
            ground: ``(2,)`` metres: the walker's place on the floor.
            yaw_rad: Its heading.
        """
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y = palm[0] - ground[0], palm[1] - ground[1]
        left = self._half_width_m - _COMPRESSION_M
        height = max(float(palm[2]), self._below_m + _FLOOR_GAP_M)
        self._offset = np.array([c * x + s * y, c * y - s * x + left, height])

    def follow(self, ground: Floats, yaw_rad: float, velocity: tuple[float, float, float]) -> None:
        """Move the held prop with the walker.

        Args:
            ground: ``(2,)`` metres: the walker's place on the floor.
            yaw_rad: Its heading.
            velocity: m/s, of the walker.
        """
        if self.prop is not None:
            place = self._reachable(self.prop, ground, yaw_rad)
            self._grip.carry(place, yaw_rad + self._yaw_rad, velocity)

    def _reachable(self, prop: Prop, ground: Floats, yaw_rad: float) -> Floats:
        """Return the place of the prop, on the walker's side of all that is solid."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y, height = self._offset
        distance_m = math.hypot(x, y)
        way = np.array([(c * x - s * y) / distance_m, (s * x + c * y) / distance_m, 0.0])
        axis = np.array([ground[0], ground[1], height])
        start_m = self._radius_m + _CLEARANCE_M
        clearance_m = self._half_width_m + _WALL_GAP_M
        start, end = (axis + metres * way for metres in (start_m, max(distance_m, start_m + 1e-3)))
        free_m = free_path_m(self._client, start, end, clearance_m, prop.body_id)
        return axis + min(distance_m, start_m + free_m) * way

    def _measured_half_width_m(self, prop: Prop, yaw_rad: float) -> float:
        """Return the distance from the prop's centre to its surface on the walker's right."""
        right = np.array([math.sin(yaw_rad), -math.cos(yaw_rad), 0.0])
        centre, reach_m = prop.position, prop.radius_m + 0.1
        outside_m = surface_m(self._client, prop.body_id, centre + reach_m * right, centre)
        return reach_m - outside_m

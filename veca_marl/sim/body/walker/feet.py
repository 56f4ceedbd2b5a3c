"""What a walker stands on: the floor, or a heavy prop that it has stepped on."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.sight import distance_m
from veca_marl.sim.body.walker.collisions.free_line import is_first_hit
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.interactions import surface_m

_ABOVE_M = 0.1  # a ray begins so far above a prop


class Footing:
    """The prop under a walker, and the height of its surface.

    Args:
        client: PyBullet's client id.

    Attributes:
        prop: What the walker stands on; None on the floor.
        height_m: Height of the surface under the walker's axis; 0 on the floor.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self.leave()

    def leave(self) -> None:
        """Stand on the floor."""
        self.prop: Prop | None = None
        self.height_m = 0.0

    def step_on(self, prop: Prop) -> None:
        """Stand on a prop, from the next call of `follow`."""
        self.prop = prop

    def follow(self, x: float, y: float) -> None:
        """Compute the height at a place; beside the prop the walker stands on the floor again."""
        if self.prop is None:
            return
        height_m = surface_height_m(self._client, self.prop, x, y)
        if height_m is None:
            self.leave()
        else:
            self.height_m = height_m


def surface_height_m(client: int, prop: Prop, x: float, y: float) -> float | None:
    """Return the height of the upper surface of a prop at a place; None beside it."""
    low, high = prop.bounds()
    top, bottom = np.array([x, y, high[2] + _ABOVE_M]), np.array([x, y, low[2] - _ABOVE_M])
    height_m = float(top[2]) - surface_m(client, prop.body_id, top, bottom)
    return height_m if height_m > bottom[2] + 1e-6 else None


def foot_steps_on(client: int, cfg: WalkerCfg, ground: Floats, prop: Prop) -> bool:
    """Return whether a tangible prop is low and near enough, and nothing solid is before it.

    Args:
        client: PyBullet's client id.
        cfg: Parameters of the walker.
        ground: ``(2,)`` metres: its place on the floor.
        prop: The prop.
    """
    height_m = surface_height_m(client, prop, *middle(prop))
    if height_m is None or height_m > cfg.step_height_m or not prop.cfg.tangible:
        return False
    foot = np.array([ground[0], ground[1], prop.lowest_m])
    if distance_m(prop, foot) - cfg.radius_m > cfg.step_reach_m:
        return False
    end, height_m = np.array([*middle(prop), height_m]), (prop.lowest_m + height_m) / 2.0
    return is_first_hit(client, prop.body_id, foot, end, cfg.radius_m, height_m)


def middle(prop: Prop) -> tuple[float, float]:
    """Return the middle of the bounding box of a prop on the floor plan, metres."""
    low, high = prop.bounds()
    return float(low[0] + high[0]) / 2.0, float(low[1] + high[1]) / 2.0

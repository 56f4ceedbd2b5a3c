"""A hand that holds one prop: the prop follows the hand and does not collide with its holder."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.props.prop import Prop


class Grip:
    """What one body holds.

    Args:
        client: PyBullet's client id.
        holder: Name of the body.
        body_ids: PyBullet's ids of what the held prop does not collide with.

    Attributes:
        prop: The held prop; None if the hand is empty.
    """

    def __init__(self, client: int, holder: str, body_ids: Sequence[int]) -> None:
        self.prop: Prop | None = None
        self._client = client
        self._holder = holder
        self._body_ids = tuple(body_ids)

    def take(self, prop: Prop) -> None:
        """Hold a prop from now on. It must be held by no other body, and the hand be empty."""
        prop.holder, self.prop = self._holder, prop
        self._set_collision(prop, 0)

    def drop(self) -> None:
        """Hold nothing from now on; nothing is moved."""
        if self.prop is not None:
            self._set_collision(self.prop, 1)
            self.prop.holder, self.prop = None, None

    def carry(self, position: Floats, yaw_rad: float) -> None:
        """Move the held prop to a pose, upright and at rest; see `Prop.set_velocity`."""
        if self.prop is not None:
            self.prop.carry(position, yaw_rad, (0.0, 0.0, 0.0))

    def _set_collision(self, prop: Prop, enabled: int) -> None:
        for body_id in self._body_ids:
            for link in prop.links:
                pybullet.setCollisionFilterPair(
                    body_id, prop.body_id, -1, link, enabled, physicsClientId=self._client
                )

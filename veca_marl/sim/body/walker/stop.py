"""A second capsule at that of a walker, which stops heavy things that press it against a wall."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.sim.physics.bullet_client import BulletClient

PARKED_M = -100.0
"""Height of a capsule that is not in use."""


class Stop:
    """Stops heavy things where a walker cannot make way for them.

    A walker does not collide with heavy things in Bullet: they displace it. Where something fixed
    is behind it, it cannot move, and Bullet has to stop them. Contacts of its own capsule cannot be
    enabled for a while: Bullet would number what they belong to anew, and by the numbers it orders
    the contacts that it solves, in later episodes as well. Hence this capsule, which collides with
    nothing but heavy things. It is far below the floor as long as it is not needed.

    Args:
        client: The PyBullet client.
        shape: PyBullet's id of the shape of the walker's capsule.
    """

    def __init__(self, client: BulletClient, shape: int) -> None:
        self._client = client
        self._body_id: int = client.createMultiBody(0, shape, basePosition=(0.0, 0.0, PARKED_M))
        self._parked = True
        client.changeDynamics(self._body_id, -1, lateralFriction=0.2, restitution=0.0)
        client.setCollisionFilterGroupMask(self._body_id, -1, 0, 0)

    def let_stop(self, body_id: int, link: int) -> None:
        """Let it stop one link of a body; -1 is the base."""
        self._client.setCollisionFilterPair(self._body_id, body_id, -1, link, 1)

    def put(self, position: Sequence[float], orientation: Sequence[float]) -> None:
        """Stop what comes to a place in the next physics step.

        Args:
            position: ``(3,)`` metres.
            orientation: ``(4,)`` quaternion (x, y, z, w).
        """
        self._parked = False
        self._client.resetBasePositionAndOrientation(self._body_id, position, orientation)

    def park(self) -> None:
        """Stop nothing from now on."""
        if not self._parked:
            self._parked = True
            upright = (0.0, 0.0, 0.0, 1.0)
            self._client.resetBasePositionAndOrientation(
                self._body_id, (0.0, 0.0, PARKED_M), upright
            )

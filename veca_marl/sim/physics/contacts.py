"""Which of Bullet's contact points are contacts.

Bullet lists points before two bodies touch, from a distance on that depends on their sizes and on
`ClockCfg.contact_share`.
"""

from __future__ import annotations

from typing import Any

from veca_marl.sim.physics.bullet import pybullet

_DISTANCE, _NORMAL_FORCE = 8, 9  # entries of Bullet's contact points


def is_contact(point: tuple[Any, ...]) -> bool:
    """Return whether two bodies touch at a contact point of the last physics step.

    They do where their surfaces meet, or where they pressed on each other in that step: the force
    of a contact may have parted them by its end.

    Args:
        point: A contact point of Bullet.
    """
    return bool(point[_DISTANCE] <= 0.0 or point[_NORMAL_FORCE] > 0.0)


def penetration_m(client: int, one: int, other: int) -> float:
    """Return how deep two bodies penetrate each other where they are now, in metres; 0 if apart.

    Collision filters have no influence, and neither body needs a mass: Bullet looks for no contacts
    between two that have none.

    Args:
        client: The PyBullet client.
        one: PyBullet's id of a body.
        other: That of another one.
    """
    points = pybullet.getClosestPoints(one, other, 0.0, physicsClientId=client)
    return max((-point[_DISTANCE] for point in points), default=0.0)


def are_in_contact(client: int, one: int, other: int) -> bool:
    """Return whether two bodies touched each other in the last physics step.

    Args:
        client: The PyBullet client.
        one: PyBullet's id of a body.
        other: That of the other one.
    """
    points = pybullet.getContactPoints(one, other, physicsClientId=client)
    return any(map(is_contact, points))

"""Contacts of a joint-level body with itself."""

from __future__ import annotations

from collections.abc import Mapping

from veca_marl.sim.physics import is_contact, pybullet


def self_contacts(client: int, body_id: int, bones: Mapping[int, str]) -> set[tuple[str, str]]:
    """Return the pairs of bones that touched each other in the last physics step.

    Args:
        client: The PyBullet client.
        body_id: Bullet's id of the body.
        bones: Bone of each link that has a collider.

    Returns:
        Each pair in the order of their names.
    """
    points = pybullet.getContactPoints(body_id, body_id, physicsClientId=client)
    pairs = [(bones[p[3]], bones[p[4]]) for p in points if is_contact(p)]
    return {(min(pair), max(pair)) for pair in pairs}

"""Self-collision: limbs collide with the trunk and with each other, not with themselves."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

from veca_marl.sim.physics import pybullet

_LEG = ("thigh", "shank", "foot")
_TRUNK = ("pelvis", "spine", "chest", "neck", "head")


def limb(bone: str) -> str:
    """Return which of `trunk`, `l_arm`, `r_arm`, `l_leg`, `r_leg` a bone belongs to."""
    if bone in _TRUNK:
        return "trunk"
    side, part = bone.split("_", 1)
    return f"{side}_leg" if part in _LEG else f"{side}_arm"


def may_collide(a: str, b: str) -> bool:
    """Return whether two bones of one body collide.

    Bones of one limb overlap at their joints by construction, and so do shoulders and hips with
    the trunk; joint limits keep them apart. Without these exceptions dozens of permanent
    contacts make the body jitter and its physics several times as expensive.
    """
    if limb(a) == limb(b):
        return False
    roots = [bone for bone in (a, b) if bone.endswith(("upper_arm", "thigh"))]
    return not (roots and "trunk" in (limb(a), limb(b)))


def allow_self_collision(client: int, body_id: int, links: Sequence[tuple[int, str]]) -> None:
    """Disable Bullet's contacts for the pairs of links that must not collide.

    Args:
        client: The PyBullet client.
        body_id: A body loaded with `URDF_USE_SELF_COLLISION`.
        links: Index and bone of every link with a collider.
    """
    for (a, bone_a), (b, bone_b) in itertools.combinations(links, 2):
        if not may_collide(bone_a, bone_b):
            pybullet.setCollisionFilterPair(body_id, body_id, a, b, 0, physicsClientId=client)


def exclude_from_collisions(client: int, body_id: int, links: Iterable[int]) -> None:
    """Exclude links without shapes from collision detection.

    Bullet gives such a link an empty shape with a bounding box of twice the detection distance,
    and keeps a pair of objects for each box that overlaps it.

    Args:
        client: The PyBullet client.
        body_id: A body.
        links: Indices of its links without shapes.
    """
    for link in links:
        pybullet.setCollisionFilterGroupMask(body_id, link, 0, 0, physicsClientId=client)

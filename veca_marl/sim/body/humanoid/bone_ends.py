"""How deep bones may be in the floor, and the ends of the bones in the frames of the links.

Where a joint passes its limit at a contact, its angle is set back, which presses bones into the
floor: by 10 to 40 mm in one physics step of a body that is driven by full torques of random sign.
Bullet's contacts push them out over several steps, and the deepest of 20 000 such steps was at
110 mm. So a body is raised by what its deepest bone has in excess of `DEEPEST_M`; momentum and
joints stay as they are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Skeleton, Underside, bone_of, forward_kinematics
from veca_marl.sim.body.humanoid.inertial_forces import locate_links
from veca_marl.sim.body.humanoid.link_tree import LinkArrays, LinkTree, empty_links, link_rows
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel
from veca_marl.sim.physics.bullet_client import BulletClient

# bones of lying, sitting and crawling bodies are at most 20 mm in the floor, those of bodies under
# random torques in 97 of 100 steps
DEEPEST_M = 0.03


class BoneEnds(NamedTuple):
    """Balls that have the hulls of the bones, on the links of a tree.

    Attributes:
        links: ``(m,)`` links of the tree.
        offsets: ``(m, 3)`` metres, centres of the balls in the frames of the links.
        radii: ``(m,)`` metres.
    """

    links: NDArray[np.int64]
    offsets: Floats
    radii: Floats


def bone_ends(
    client: BulletClient, body_id: int, skeleton: Skeleton, tree: LinkTree, base_centre: Floats
) -> BoneEnds:
    """Return the ends of all bones, without the skin.

    Args:
        client: The PyBullet client.
        body_id: The body.
        skeleton: Its bones.
        tree: Its links.
        base_centre: ``(3,)`` metres, the base's centre of mass in the frame of the pelvis.
    """
    names = [bone.name for bone in skeleton.bones]
    positions, rotations = np.zeros((len(names), 3)), np.tile(np.eye(3), (len(names), 1, 1))
    positions[0] = -base_centre
    forward_kinematics(skeleton, np.zeros(len(skeleton.joints)), positions, rotations)
    links = empty_links(tree.hinges)
    locate_links(tree, np.eye(3), np.zeros(tree.hinges), links)
    rows = {"pelvis": 0}
    for link, row in link_rows(client, body_id).items():
        if link >= 0:
            rows[bone_of(client.getJointInfo(body_id, link).link_name.decode())] = row
    for bone in skeleton.bones:  # fixed fingers are part of the hand's link
        rows.setdefault(bone.name, rows[names[max(bone.parent, 0)]])
    under = Underside(skeleton, names, skin=False)
    owners = np.array([rows[names[frame]] for frame in under.frames])
    world = positions[under.frames] + np.einsum(
        "nij,nj->ni", rotations[under.frames], under.offsets
    )
    offsets = np.einsum("nji,nj->ni", links.rotations[owners], world - links.origins[owners])
    return BoneEnds(owners, np.ascontiguousarray(offsets), under.radii)


@kernel
def excess_m(ends: BoneEnds, links: LinkArrays, height_m: float) -> float:
    """Return by how much the deepest bone is deeper than `DEEPEST_M`; 0 if none is.

    Args:
        ends: The ends of the bones.
        links: Where the links are.
        height_m: Height of the base's centre of mass above the floor.
    """
    lowest = math.inf
    for n in range(ends.links.shape[0]):
        up, at = links.rotations[ends.links[n], 2], ends.offsets[n]
        along = up[0] * at[0] + up[1] * at[1] + up[2] * at[2]
        lowest = min(lowest, links.origins[ends.links[n], 2] + along - ends.radii[n])
    return max(-DEEPEST_M - height_m - lowest, 0.0)

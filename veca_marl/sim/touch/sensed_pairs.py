"""Which primitives are sensed by which bones of a body."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton, load_skeleton
from veca_marl.sim.body.humanoid.self_collision import may_collide
from veca_marl.sim.geometry import Bools, GeomTable, SceneObject


def unsensed_bones(skeleton: Skeleton) -> Bools:
    """Return the ``(47, 47)`` symmetric mask of pairs of bones that are not sensed.

    These are a bone with itself, its parent, its children and the other children of its parent,
    which joints keep in contact, unless the two collide in the physics, as thighs and upper arms
    do.
    """
    parents = skeleton.parents
    near = np.eye(len(parents), dtype=np.bool_) | (parents[:, None] == parents[None, :])
    child_of: Bools = parents[:, None] == np.arange(len(parents))[None, :]
    names = [bone.name for bone in skeleton.bones]
    collide = np.array([[may_collide(a, b) for b in names] for a in names])
    unsensed: Bools = (near | child_of | child_of.T) & ~collide
    return unsensed


def unsensed_primitives(geoms: GeomTable, body: SceneObject) -> Bools:
    """Return the mask ``(47, G)`` of intangible primitives and of unsensed bones of the body."""
    skeleton = load_skeleton()
    ignored = np.repeat(~geoms.tangible[None], len(skeleton.bones), axis=0)
    own = np.flatnonzero(geoms.objects == body.id)
    ignored[:, own] |= unsensed_bones(skeleton)[:, geoms.frames[own] - body.rows.start]
    return ignored

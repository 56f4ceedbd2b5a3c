"""Triangles of the skin that overlap with other bones of the same body without being in contact.

The primitives of bones overlap inside the body, and the mesh continues inside its joints. With a
receptive field some taxels there would sense their own body in every pose.
"""

from __future__ import annotations

import functools

import numpy as np

from veca_marl.sim.body.anatomy import binding_pose, load_skeleton
from veca_marl.sim.body.appearance import SKIN, bone_geoms, dressed_skin
from veca_marl.sim.geometry import Bools, Scene
from veca_marl.sim.touch.penetration import empty_workspace, read_taxels
from veca_marl.sim.touch.receptive_fields import fields_of
from veca_marl.sim.touch.rigid_bones import rigid_bones
from veca_marl.sim.touch.sensed_pairs import unsensed_primitives
from veca_marl.sim.touch.taxels import load_taxels


@functools.cache
def overlapping_triangles(share: float) -> Bools:
    """Return the mask ``(T,)`` of triangles that read their own body in the binding pose.

    In that pose arms and legs are spread, and no part of the body is in contact with another.

    Args:
        share: Radius of the receptive fields as a share of `TaxelTable.gaps`.
    """
    skeleton, taxels, scene = load_skeleton(), load_taxels(), Scene()
    body = scene.add_object("body", bone_geoms(skeleton, SKIN), dressed_skin(skeleton, SKIN))
    body.positions[:], body.rotations[:] = binding_pose(skeleton)
    scene.update()
    vertices, readings = scene.meshes.vertices, np.zeros(taxels.depths.shape)
    read_taxels(
        taxels,
        fields_of(taxels, share, body.id),
        vertices,
        scene.geoms,
        rigid_bones(scene.geoms, body, len(skeleton.bones)),
        unsensed_primitives(scene.geoms, body),
        empty_workspace(taxels, len(vertices), len(scene.geoms.shapes)),
        readings,
    )
    overlapping: Bools = readings.max(axis=1) > 0.0
    return overlapping

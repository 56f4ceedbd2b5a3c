"""The skin of the skeleton."""

from __future__ import annotations

import functools

from veca_marl.sim.body.anatomy.bone_tables import load_skeleton
from veca_marl.sim.body.anatomy.skin_mesh.binding import bind
from veca_marl.sim.body.anatomy.skin_mesh.body_parts import loft_left_side, loft_trunk
from veca_marl.sim.body.anatomy.skin_mesh.loft import Loft
from veca_marl.sim.geometry import Mesh


@functools.cache
def load_skin() -> Mesh:
    """Return the skin of the skeleton, grey, its triangles sorted by bone (once per process)."""
    skeleton = load_skeleton()
    loft = Loft(skeleton)
    loft_trunk(loft)
    first_vertex, first_triangle = len(loft.points), len(loft.triangles)
    loft_left_side(loft, skeleton)
    loft.mirror(first_vertex, first_triangle)
    return bind(skeleton, loft)

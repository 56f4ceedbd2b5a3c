"""The skin as a mesh: tubes lofted over the bones, exactly 1648 triangles and 894 vertices.

Rings of points in the frames of the bones are joined by bands of triangles and closed by caps. The
rims of thighs and fingers are open; they lie inside pelvis, feet and palms. The right side is the
mirror image of the left.
"""

from veca_marl.sim.body.anatomy.skin_mesh.binding import binding_pose
from veca_marl.sim.body.anatomy.skin_mesh.skin import load_skin

__all__ = ["binding_pose", "load_skin"]

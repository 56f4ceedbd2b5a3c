"""The picture of the named parts of the skin, front and back."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import binding_pose, load_skeleton
from veca_marl.sim.body.appearance import SKIN, bone_geoms, dressed_skin
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.touch import skin_parts
from veca_marl.sim.vision import Camera, look_at

mpl.use("Agg")
import matplotlib.pyplot as plt

_ABOVE_M = 2.0  # above the floor, where there are no contact shadows
_AWAY_M, _MIDDLE_M = 1.5, np.array([0.0, 0.0, _ABOVE_M + 0.03])
_WALL_M = 2.5  # white walls in front of and behind the body are the background


def parts_picture(path: Path) -> None:
    """Draw a body with the parts of its skin in different colours, mirrored parts in the same."""
    skeleton, scene = load_skeleton(), Scene()
    body = scene.add_object("body", bone_geoms(skeleton, SKIN), dressed_skin(skeleton, SKIN))
    for way in (-1.0, 1.0):
        wall = Geom(Shape.BOX, (0.01, 5.0, 5.0), (way * _WALL_M, 0.0, 0.0), colour=(1.0, 1.0, 1.0))
        scene.add_object(f"wall {way}", [[wall]])
    body.positions[:], body.rotations[:] = binding_pose(skeleton)
    body.positions[:, 2] += _ABOVE_M
    scene.surfaces.colours[len(scene.geoms.shapes) :] = part_colours()
    scene.update()
    camera = Camera(360, 420, fov_deg=34.0)
    views = [
        look_at(_MIDDLE_M + np.array([way * _AWAY_M, 0.0, 0.05]), _MIDDLE_M) for way in (1.0, -1.0)
    ]
    plt.imsave(path, np.concatenate(list(camera.render(scene, views).rgb), axis=1))


def part_colours() -> NDArray[np.float64]:
    """Return the colour of each triangle, ``(1648, 3)`` in [0, 1]."""
    names = [part.name.removeprefix("l_").removeprefix("r_") for part in skin_parts()]
    palette = plt.get_cmap("tab20")
    of_name = {name: palette(i % palette.N)[:3] for i, name in enumerate(dict.fromkeys(names))}
    colours = np.zeros((1648, 3))
    for part, name in zip(skin_parts(), names, strict=True):
        colours[part.triangles] = of_name[name]
    return colours

"""Costs of views of one body: its skin beside its bones, and most of it out of view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from veca_marl.bench.stopwatch import thread_ms
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.physics import PlaygroundCfg, World
from veca_marl.sim.vision import Camera, Views, look_at

_HANDS_IN_VIEW = Posture(
    0.0, {"upper_arm.flexion": 60.0, "forearm.flexion": 60.0, "head.flexion": 12.0}
)
_OTHER_EYE_M = (1.0, 0.3, 0.2)
"""Position from the pelvis from which the whole body is in the picture."""


@dataclass
class BodyViews:
    """Processor time of one 84x84 view of one `full` body, without its surroundings.

    Attributes:
        skin_ms: Its skin from 1 m.
        bones_ms: The primitives of its bones instead of its skin, from the same position.
        own_ms: Its skin without its head from its own eye: most triangles are out of view.
    """

    skin_ms: float
    bones_ms: float
    own_ms: float


def measure_body_views(playground: PlaygroundCfg, repeats: int) -> BodyViews:
    """Measure one `full` body, in turns; the results are medians."""
    world = World(playground)
    views = body_views(world)
    for render in views:
        render()  # the first call compiles and fills caches
    costs = [[thread_ms(render) for render in views] for _ in range(repeats)]
    world.close()
    return BodyViews(*(median(column) for column in zip(*costs, strict=True)))


def body_views(world: World) -> list[Callable[[], Views]]:
    """Add a body to a world; return what renders the views of `BodyViews`, in their order."""
    child = Humanoid("child", HumanoidCfg(), world)
    child.place((0.0, 0.0, 1.0), posture=_HANDS_IN_VIEW)
    scene = world.scene
    scene.update()
    scene.geoms.visible[:] = True
    others = scene.surfaces.objects != child.object_id
    bones = np.arange(len(others)) < len(scene.geoms.shapes)
    head = scene.hidden(child.object_id, child.own_head_frames)
    other = look_at(child.position + _OTHER_EYE_M, child.position)
    own = child.mount("eye_left")
    views = [(other, others | bones), (other, others | ~bones), (own, others | bones | head)]
    return [partial(Camera().render, scene, [pose], hidden) for pose, hidden in views]

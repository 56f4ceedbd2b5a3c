"""Cost of the skin: skinning, and reading the taxels for several numbers of contacts."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from veca_marl.bench.stopwatch import thread_ms
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Geom, Shape, deform_meshes
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, World
from veca_marl.sim.touch import TouchCfg, TouchSense

CONTACTS = (0, 3, 20)
DISTANT = 300
_ARMS_OUT = Posture(0.0, {"upper_arm.abduction": 30.0})  # no self-contact
_RADIUS_M = 0.03


@dataclass
class SkinCosts:
    """Cost of the skin of one body.

    Attributes:
        skinning_ms: Milliseconds of computing the vertices from the poses of the bones.
        touch_ms: Milliseconds of one reading of all taxels, by the number of contacts.
        distant_ms: That with 3 contacts, beside `DISTANT` primitives that touch nothing.
    """

    skinning_ms: float
    touch_ms: dict[int, float]
    distant_ms: float


def measure_skin(playground: PlaygroundCfg, repeats: int) -> SkinCosts:
    """Measure a `full` body in the air with small balls on its skin."""
    readings = {contacts: _touch_ms(playground, contacts, repeats) for contacts in CONTACTS}
    distant_ms = _touch_ms(playground, 3, repeats, distant=DISTANT)
    return SkinCosts(_skinning_ms(playground, repeats), readings, distant_ms)


def touched_child(
    playground: PlaygroundCfg, contacts: int, distant: int = 0
) -> tuple[World, TouchSense]:
    """Return a world with a body in the air and `contacts` balls on its skin, and its touch.

    `distant` further balls are 5 m away.
    """
    world = World(playground)
    cfgs = [PropCfg(f"ball_{i}", PropShape.sphere, [_RADIUS_M]) for i in range(contacts)]
    balls = [world.add_prop(cfg) for cfg in cfgs]
    far = Geom(Shape.SPHERE, (_RADIUS_M,), offset=(5.0, 0.0, 1.0))
    world.scene.add_object("distant", [[far] * distant])
    child = Humanoid("child", HumanoidCfg(), world)
    child.place((0.0, 0.0, 1.0), posture=_ARMS_OUT)
    world.scene.update()
    sense = TouchSense(TouchCfg(), child, world)
    vertices = world.scene.meshes.vertices
    for ball, row in zip(balls, np.linspace(0, len(vertices) - 1, contacts), strict=True):
        ball.place(vertices[int(row)])
    world.scene.update()
    return world, sense


def _touch_ms(playground: PlaygroundCfg, contacts: int, repeats: int, distant: int = 0) -> float:
    world, sense = touched_child(playground, contacts, distant)
    sense.compute()
    cost = median(thread_ms(sense.compute) for _ in range(repeats))
    world.close()
    return cost


def _skinning_ms(playground: PlaygroundCfg, repeats: int) -> float:
    world, _ = touched_child(playground, 0)
    scene = world.scene

    def follow() -> None:
        deform_meshes(scene.meshes, scene.positions, scene.rotations)

    follow()
    cost = median(thread_ms(follow) for _ in range(repeats))
    world.close()
    return cost

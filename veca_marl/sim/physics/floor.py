"""The floor: a plane for physics, a box with a pattern for eyes and skins."""

from __future__ import annotations

from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.playground import PlaygroundCfg

FLOOR_NAME = "floor"
_THICKNESS_M = 0.1


def add_floor(client: int, scene: Scene, playground: PlaygroundCfg) -> int:
    """Add the floor to Bullet and to the scene; return its id in Bullet.

    Its friction and restitution are 1: Bullet multiplies them by those of what touches it.
    """
    x, y = playground.floor_size_m
    half = (x / 2, y / 2, _THICKNESS_M / 2)
    geom = Geom(
        Shape.BOX,
        half,
        offset=(*playground.floor_centre_m, -half[2]),
        colour=playground.floor_colour,
        checker_m=playground.floor_checker_m,
    )
    scene.add_object(FLOOR_NAME, [[geom]])
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    floor_id: int = pybullet.createMultiBody(0, plane, physicsClientId=client)
    pybullet.changeDynamics(
        floor_id, -1, lateralFriction=1.0, restitution=1.0, physicsClientId=client
    )
    return floor_id

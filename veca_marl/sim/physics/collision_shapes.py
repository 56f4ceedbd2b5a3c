"""Primitives as Bullet takes them: arguments of its functions, collision shapes and URDF text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from veca_marl.sim.geometry import Primitive, Shape, matrix_to_quaternion
from veca_marl.sim.physics.bullet import pybullet

_BULLET_SHAPES: dict[Shape, int] = {
    Shape.SPHERE: pybullet.GEOM_SPHERE,
    Shape.BOX: pybullet.GEOM_BOX,
    Shape.CYLINDER: pybullet.GEOM_CYLINDER,
    Shape.CAPSULE: pybullet.GEOM_CAPSULE,
}


def shape_arguments(shape: Shape, size: Sequence[float]) -> dict[str, Any]:
    """Return the arguments that describe a primitive to PyBullet's `createVisualShape`.

    Args:
        shape: Its shape.
        size: As in `Primitive`; further entries are not used.
    """
    numbers = [float(value) for value in size]
    arguments: dict[str, Any] = {"shapeType": _BULLET_SHAPES[shape]}
    if shape is Shape.BOX:
        return arguments | {"halfExtents": numbers}
    arguments |= {"radius": numbers[0]}
    return arguments if shape is Shape.SPHERE else arguments | {"length": numbers[1]}


def create_collision_shape(client: int, primitives: Sequence[Primitive]) -> int:
    """Create one collision shape of one or several primitives on the same frame; return its id."""
    arguments = [shape_arguments(part.shape, part.size) for part in primitives]
    shape = pybullet.createCollisionShapeArray(
        shapeTypes=[each["shapeType"] for each in arguments],
        radii=[each.get("radius", 0.0) for each in arguments],
        halfExtents=[each.get("halfExtents", [0.0, 0.0, 0.0]) for each in arguments],
        lengths=[each.get("length", 0.0) for each in arguments],
        collisionFramePositions=[np.asarray(part.offset).tolist() for part in primitives],
        collisionFrameOrientations=[
            matrix_to_quaternion(np.asarray(part.rotation)).tolist() for part in primitives
        ],
        physicsClientId=client,
    )
    return int(shape)


def urdf_geometry(primitive: Primitive) -> str:
    """Return the element below ``<geometry>`` that describes a primitive; its pose is elsewhere."""
    if primitive.shape is Shape.BOX:
        edges = " ".join(f"{2.0 * half:.12g}" for half in primitive.size)
        return f'<box size="{edges}"/>'
    radius = f'radius="{primitive.radius:.9g}"'
    if primitive.shape is Shape.SPHERE:
        return f"<sphere {radius}/>"
    return f'<{primitive.shape.name.lower()} {radius} length="{primitive.length:.9g}"/>'

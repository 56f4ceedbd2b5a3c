"""Primitives as Bullet takes them: arguments of its functions, collision shapes and URDF text."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from veca_marl.sim.geometry import Polyhedron, Primitive, Shape, matrix_to_quaternion
from veca_marl.sim.physics.bullet import pybullet

HULL_MARGIN_M = 0.001
"""Bullet adds this margin to every hull (`gDefaultCollisionMargin` of its importer)."""

_BULLET_SHAPES: dict[Shape, int] = {
    Shape.SPHERE: pybullet.GEOM_SPHERE,
    Shape.BOX: pybullet.GEOM_BOX,
    Shape.CYLINDER: pybullet.GEOM_CYLINDER,
    Shape.CAPSULE: pybullet.GEOM_CAPSULE,
    Shape.POLYHEDRON: pybullet.GEOM_MESH,
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
    """Create one collision shape of one or several primitives on the same frame; return its id.

    Bullet reads hulls from files only when there are several shapes; the files are deleted. A body
    with such a shape needs a visual shape, see `unused_visual_shape`.
    """
    with _folder_of_hulls(primitives) as folder:
        arguments = [_with_file(part, folder / f"{i}.obj") for i, part in enumerate(primitives)]
        shape = pybullet.createCollisionShapeArray(
            shapeTypes=[each["shapeType"] for each in arguments],
            radii=[each.get("radius", 0.0) for each in arguments],
            halfExtents=[each.get("halfExtents", [0.0, 0.0, 0.0]) for each in arguments],
            lengths=[each.get("length", 0.0) for each in arguments],
            fileNames=[each.get("fileName", "") for each in arguments],
            meshScales=[[1.0, 1.0, 1.0]] * len(arguments),
            collisionFramePositions=[np.asarray(part.offset).tolist() for part in primitives],
            collisionFrameOrientations=[
                matrix_to_quaternion(np.asarray(part.rotation)).tolist() for part in primitives
            ],
            physicsClientId=client,
        )
    return int(shape)


@contextmanager
def _folder_of_hulls(primitives: Sequence[Primitive]) -> Iterator[Path]:
    """Make a folder for the files of hulls and delete it afterwards.

    Without hulls no folder is made: most primitives have none, and making one takes longer than
    creating the shape. The path is not used then.
    """
    if any(part.hull for part in primitives):
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder)
    else:
        yield Path()


def unused_visual_shape(client: int, primitives: Sequence[Primitive]) -> int:
    """Return the id of a visual shape for a body with these primitives; -1 if it needs none.

    For a body without one Bullet draws the collision shape itself, and would read the files of
    hulls again, which are deleted. Its pictures are not used: eyes see the scene.
    """
    if not any(part.hull for part in primitives):
        return -1
    return int(
        pybullet.createVisualShape(pybullet.GEOM_SPHERE, radius=0.001, physicsClientId=client)
    )


def _with_file(primitive: Primitive, path: Path) -> dict[str, Any]:
    """Return the arguments of a primitive for PyBullet; a hull is written to a file first."""
    if primitive.hull is None:
        return shape_arguments(primitive.shape, primitive.size)
    path.write_text(_as_obj(primitive.hull.grown(-HULL_MARGIN_M)))
    return {"shapeType": pybullet.GEOM_MESH, "fileName": str(path)}


def _as_obj(polyhedron: Polyhedron) -> str:
    """Return a polyhedron as Wavefront OBJ."""
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in polyhedron.vertices]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in polyhedron.triangles]
    return "\n".join(rows) + "\n"


def urdf_geometry(primitive: Primitive) -> str:
    """Return the element below ``<geometry>`` that describes a primitive; its pose is elsewhere.

    Raises:
        ValueError: For a polyhedron, which URDF reads from a file.
    """
    if primitive.hull is not None:
        raise ValueError("a polyhedron has no URDF element of numbers")
    if primitive.shape is Shape.BOX:
        edges = " ".join(f"{2.0 * half:.12g}" for half in primitive.size)
        return f'<box size="{edges}"/>'
    radius = f'radius="{primitive.radius:.9g}"'
    if primitive.shape is Shape.SPHERE:
        return f"<sphere {radius}/>"
    return f'<{primitive.shape.name.lower()} {radius} length="{primitive.length:.9g}"/>'

"""Shapes, contacts and rays of PyBullet.

Bullet lists contact points before two bodies touch, from a distance on that depends on their sizes
and on `ClockCfg.contact_share`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from veca_marl.sim.geometry import Floats, Polyhedron, Primitive, Shape, matrix_to_quaternion
from veca_marl.sim.physics.bullet_client import BulletClient, ContactPoint, pybullet

__all__ = [
    "HULL_MARGIN_M",
    "BuiltContacts",
    "are_in_contact",
    "create_collision_shape",
    "free_path_m",
    "is_contact",
    "penetration_m",
    "shape_arguments",
    "surface_m",
    "unused_visual_shape",
    "urdf_geometry",
]

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


def create_collision_shape(client: BulletClient, primitives: Sequence[Primitive]) -> int:
    """Create one collision shape of one or several primitives on the same frame; return its id.

    Bullet reads hulls from files only when there are several shapes; the files are deleted. A body
    with such a shape needs a visual shape, see `unused_visual_shape`.
    """
    with _folder_of_hulls(primitives) as folder:
        arguments = [_with_file(part, folder / f"{i}.obj") for i, part in enumerate(primitives)]
        shape = client.createCollisionShapeArray(
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


def unused_visual_shape(client: BulletClient, primitives: Sequence[Primitive]) -> int:
    """Return the id of a visual shape for a body with these primitives; -1 if it needs none.

    For a body without one Bullet draws the collision shape itself, and would read the files of
    hulls again, which are deleted. Its pictures are not used: eyes see the scene.
    """
    if not any(part.hull for part in primitives):
        return -1
    return int(client.createVisualShape(pybullet.GEOM_SPHERE, radius=0.001))


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


def is_contact(point: ContactPoint) -> bool:
    """Return whether two bodies touch at a contact point of the last physics step.

    They do where their surfaces meet, or where they pressed on each other in that step: the force
    of a contact may have parted them by its end.

    Args:
        point: A contact point of the last physics step.
    """
    return point.distance_m <= 0.0 or point.normal_force_n > 0.0


def penetration_m(client: BulletClient, one: int, other: int) -> float:
    """Return how deep two bodies penetrate each other where they are now, in metres; 0 if apart.

    Collision filters have no influence, and neither body needs a mass: Bullet looks for no contacts
    between two that have none.

    Args:
        client: The PyBullet client.
        one: PyBullet's id of a body.
        other: That of another one.
    """
    points = client.getClosestPoints(one, other, 0.0)
    return max((-point.distance_m for point in points), default=0.0)


def are_in_contact(client: BulletClient, one: int, other: int) -> bool:
    """Return whether two bodies touched each other in the last physics step.

    Args:
        client: The PyBullet client.
        one: PyBullet's id of a body.
        other: That of the other one.
    """
    points = client.getContactPoints(one, other)
    return any(map(is_contact, points))


class BuiltContacts:
    """Keeps contacts of other states out of a restored one, so that it equals a fresh world.

    What overlaps in the built world is usually placed elsewhere after it has been restored. Bullet
    would keep its contacts for a while; for how long depends on the episodes before. It discards
    the contacts of the last episode only if the saved state holds contacts.

    Args:
        client: The PyBullet client, after its collision detection in the built state.
        floor_id: PyBullet's id of the floor; contacts with it are saved and restored.
    """

    def __init__(self, client: BulletClient, floor_id: int) -> None:
        self._client = client
        touching = {
            (point.body_a, point.body_b, point.link_a, point.link_b)
            for point in client.getContactPoints()
            if point.body_a != point.body_b
        }
        overlaps = {pair for pair in touching if floor_id not in pair[:2]}
        # the same ones at each reset: Bullet numbers the links that are named here anew, and the
        # numbers decide about the order in which it solves contacts
        self._forgotten = sorted(overlaps)
        if touching == overlaps:  # no contact is saved
            links = sorted(_moving_links(client) - {(floor_id, -1)})
            self._forgotten += [(floor_id, body, -1, link) for body, link in links]

    @contextmanager
    def forgotten(self) -> Iterator[None]:
        """Save or restore the built state without the contacts that must not be kept."""
        self._let_collide(False)
        try:
            yield
        finally:
            self._let_collide(True)

    def _let_collide(self, collide: bool) -> None:
        """Let links collide or not; Bullet forgets the contacts of those that do not."""
        for one, other, link, other_link in self._forgotten:
            self._client.setCollisionFilterPair(one, other, link, other_link, int(collide))


def _moving_links(client: BulletClient) -> set[tuple[int, int]]:
    """Return all links that move and have a collision shape, with their bodies."""
    bodies = [client.getBodyUniqueId(i) for i in range(client.getNumBodies())]
    return {
        (body, link)
        for body in bodies
        for link in range(-1, client.getNumJoints(body))
        if client.getDynamicsInfo(body, link).mass_kg > 0.0
        and client.getCollisionShapeData(body, link)
    }


_LEAST_COSINE = 0.3  # of the angle between a ray and a normal: at flatter angles it is used instead


def free_path_m(
    client: BulletClient, start: Floats, end: Floats, clearance_m: float, ignored_id: int
) -> float:
    """Return how far a ball can move along a line before it touches something solid.

    The ray of its centre decides: at a plane that it meets at an angle the distance is exact, and
    things that the ray misses do not count.

    Args:
        client: The PyBullet client.
        start: ``(3,)`` metres, outside of all things.
        end: ``(3,)`` metres.
        clearance_m: Radius of the ball.
        ignored_id: PyBullet's id of a body that does not count.

    Returns:
        Metres from `start`, at most the distance to `end`; negative if the ball has to move back.
    """
    length_m = float(np.linalg.norm(end - start))
    way = (end - start) / length_m
    longer = start + (length_m + clearance_m / _LEAST_COSINE) * way
    free_m = length_m
    for hit in _hits(client, start, longer):
        if hit.body_id != ignored_id:
            cosine = max(abs(float(hit.normal @ way)), _LEAST_COSINE)
            free_m = min(free_m, hit.distance_m - clearance_m / cosine)
    return free_m


def surface_m(client: BulletClient, body_id: int, start: Floats, end: Floats) -> float:
    """Return the distance from `start` to the surface of one body on the way to `end`.

    Args:
        client: The PyBullet client.
        body_id: PyBullet's id of the body; other things do not count.
        start: ``(3,)`` metres, outside of it.
        end: ``(3,)`` metres.

    Returns:
        Metres; the distance to `end` if the ray misses the body.
    """
    its = (hit.distance_m for hit in _hits(client, start, end) if hit.body_id == body_id)
    return min(its, default=float(np.linalg.norm(end - start)))


class _Hit(NamedTuple):
    body_id: int
    distance_m: float
    normal: Floats


def _hits(client: BulletClient, start: Floats, end: Floats) -> Iterator[_Hit]:
    """Yield all that a ray hits, in Bullet's order, which is not that of the distance."""
    length_m = float(np.linalg.norm(end - start))
    for number in count():
        (hit,) = client.rayTestBatch([start.tolist()], [end.tolist()], reportHitNumber=number)
        if hit.body_id == -1:
            return
        yield _Hit(hit.body_id, hit.fraction * length_m, np.array(hit.normal))

"""One taxel on flat skin over flat bone, and the things that approach it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats, Geom, Polyhedron, Scene, Shape, pyramid
from veca_marl.sim.touch import TAXELS_PER_TRIANGLE, TaxelTable
from veca_marl.sim.touch.penetration import empty_workspace, read_taxels
from veca_marl.sim.touch.rigid_bones import rigid_bones
from veca_marl.sim.touch.taxels import Fields

_BONE_M = 0.25  # half edge of the block of bone; exact in single precision
_TRIANGLE_M = 1e-4  # small, so that the six taxels read nearly the same


@dataclass(frozen=True, eq=False)
class Thing:
    """A primitive that touches the skin.

    Attributes:
        shape: Its shape.
        size: Metres, as in `Primitive`.
        rotation: ``(3, 3)`` from its axes to those of the skin.
        skin_m: Thickness of its own skin, its outer layer.
        hull: The polyhedron; None for all other shapes.
    """

    shape: Shape
    size: tuple[float, ...]
    rotation: Floats
    skin_m: float = 0.0
    hull: Polyhedron | None = None

    def foremost(self, direction: Floats) -> Floats:
        """Return the point farthest along a direction, ``(3,)`` metres from its centre.

        Where an edge or a face is farthest, its middle.
        """
        local = self.rotation.T @ direction
        local[np.abs(local) < 1e-9] = 0.0
        if self.hull is not None:
            heights = self.hull.vertices @ local
            highest = self.hull.vertices[heights > heights.max() - 1e-9]
            return self._turned(highest.mean(axis=0))
        if self.shape is Shape.BOX:
            return self._turned(np.sign(local) * np.array(self.size))
        if self.shape is Shape.SPHERE:
            return self._turned(self.size[0] * local)
        axis = np.array([0.0, 0.0, 0.5 * self.size[1] * np.sign(local[2])])
        if self.shape is Shape.CYLINDER:
            local = local * (1.0, 1.0, 0.0)
            local /= max(float(np.linalg.norm(local)), 1e-12)
        return self._turned(self.size[0] * local + axis)

    def _turned(self, point: Floats) -> Floats:
        turned: Floats = self.rotation @ point
        return turned


class FlatSkin:
    """Skin with its surface at z = 0 and its bone below, and one taxel at the origin.

    Args:
        thickness_m: Thickness of the skin.
        radius_m: Radius of the receptive field; 0 for a point.
        thing: What touches it.
    """

    def __init__(self, thickness_m: float, radius_m: float, thing: Thing) -> None:
        scene = Scene()
        half = _BONE_M + thickness_m
        block = Geom(Shape.BOX, (half, half, half), (0.0, 0.0, -half), skin_m=thickness_m)
        skin = scene.add_object("skin", [[block]])
        geom = Geom(
            thing.shape,
            thing.size,
            (0, 0, 0),
            thing.rotation,
            skin_m=thing.skin_m,
            hull=thing.hull,
        )
        scene.add_object("thing", [[geom]])
        scene.update()
        self._geoms = scene.geoms
        self._own = rigid_bones(self._geoms, skin, 1)
        self._taxels = _one_triangle(thickness_m)
        self._fields = Fields(np.full((2, 1), radius_m), np.full(2, radius_m), skin.id, 0)
        self._ignored = np.array([[True, False]])
        self._workspace = empty_workspace(self._taxels, len(_CORNERS), len(self._geoms.shapes))
        self._readings = np.zeros((1, TAXELS_PER_TRIANGLE))

    def read(self, centre: Floats) -> float:
        """Return the reading with the centre of the thing at a place, ``(3,)`` metres."""
        self._geoms.positions[1] = centre
        read_taxels(
            self._taxels,
            self._fields,
            _CORNERS,
            self._geoms,
            self._own,
            self._ignored,
            self._workspace,
            self._readings,
        )
        return float(self._readings[0, 0])


def _corners() -> Floats:
    """Return the corners ``(3, 3)`` of a triangle that faces +z, its first taxel at the origin."""
    angles = np.deg2rad((0.0, 120.0, 240.0))
    corners = _TRIANGLE_M * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    moved: Floats = corners - np.array([2 / 3, 1 / 6, 1 / 6]) @ corners
    return moved


def _one_triangle(thickness_m: float) -> TaxelTable:
    """Return the table of the taxels of one triangle on one bone."""
    ends = np.array([0, 1])
    return TaxelTable(
        triangles=np.array([[0, 1, 2]]),
        first_triangle=ends,
        depths=np.zeros((1, TAXELS_PER_TRIANGLE)),
        thickness=np.array([thickness_m]),
        first_patch=ends,
        patches=ends,
        vertices=np.arange(3),
        first_vertex=np.array([0, 3]),
        gaps=np.array([_TRIANGLE_M / 2]),
        margins=np.zeros(1),
        layers=np.zeros((1, 2)),
    )


_CORNERS = _corners()


SHAPES = (Shape.SPHERE, Shape.BOX, Shape.CYLINDER, Shape.CAPSULE)
WIDTHS_M = (0.003, 0.005, 0.01, 0.02, 0.04)
SKINS_M = (0.0015, 0.004, 0.01)
PATHS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
TILTS_DEG = (0.0, 20.0, 40.0, 60.0, 75.0)
_PAST_M = 1e-7  # past the bone, so that rounding does not matter
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Approach:
    """A thing that moves on a straight line until its foremost point meets the bone below a taxel.

    Attributes:
        shape: Of the thing; a polyhedron is a pyramid.
        width_m: Its smallest extent, about.
        skin_m: Thickness of the skin.
        path_deg: Angle of its path to the normal of the skin.
        tilt_deg: Angle of its axis to the normal of the skin.
        turn_deg: Direction of the tilt about the normal; 0 is in the plane of the path.
        radius: Radius of the receptive field as a multiple of the thickness of the skin.
    """

    shape: Shape
    width_m: float
    skin_m: float
    path_deg: float = 0.0
    tilt_deg: float = 0.0
    turn_deg: float = 0.0
    radius: float = 1.0

    def thing(self) -> Thing:
        """Return the thing."""
        tilt = rotation(2, self.turn_deg) @ rotation(1, self.tilt_deg)
        if self.shape is Shape.POLYHEDRON:
            hull = pyramid(self.width_m, 1.3 * self.width_m, 1.2 * self.width_m)
            return Thing(self.shape, (), tilt, hull=hull)
        return Thing(self.shape, size_of(self.shape, self.width_m), tilt)

    def readings(self, steps: int) -> Floats:
        """Return the readings ``(steps,)`` from outside the skin to contact with the bone."""
        thing = self.thing()
        skin = FlatSkin(self.skin_m, self.radius * self.skin_m, thing)
        path = rotation(1, 180.0 - self.path_deg) @ _UP
        end = -self.skin_m * _UP - thing.foremost(path)
        return np.array([skin.read(end - away * path) for away in self.distances_m(steps)])

    def distances_m(self, steps: int) -> Floats:
        """Return the distances ``(steps,)`` of the foremost point from the bone on the way."""
        start_m = (self.skin_m + 0.001) / np.cos(np.deg2rad(self.path_deg)) + 2.0 * self.width_m
        return np.append(np.linspace(start_m, 0.0, steps - 1), -_PAST_M)


def size_of(shape: Shape, width_m: float) -> tuple[float, ...]:
    """Return the size of a thing of about a given width, see `Primitive`."""
    half = width_m / 2
    return {
        Shape.SPHERE: (half,),
        Shape.BOX: (half, 1.3 * half, 0.8 * half),
        Shape.CYLINDER: (half, 3 * half),
        Shape.CAPSULE: (half, 2 * half),
    }[shape]


def rotation(axis: int, degrees: float) -> Floats:
    """Return the rotation about a coordinate axis."""
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    turn = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn[i, i] = turn[j, j] = cosine
    turn[i, j], turn[j, i] = -sine, sine
    return turn


def all_approaches(rng: np.random.Generator, radii: Sequence[float]) -> Iterator[Approach]:
    """Yield an approach for each combination, with tilts in random directions."""
    combinations = (SHAPES, WIDTHS_M, SKINS_M, PATHS_DEG, TILTS_DEG, radii)
    for shape, width, skin, path, tilt, radius in itertools.product(*combinations):
        yield Approach(shape, width, skin, path, tilt, float(rng.uniform(0.0, 360.0)), radius)


@dataclass(frozen=True)
class Extremes:
    """What the readings of many approaches have in common.

    Attributes:
        count: Number of approaches.
        largest_fall: The largest difference of a reading from an earlier one that was larger.
        least_at_bone: The smallest reading at contact with the bone.
    """

    count: int
    largest_fall: float
    least_at_bone: float


def extremes(approaches: Sequence[Approach], steps: int) -> Extremes:
    """Measure approaches in a number of steps each."""
    readings = np.array([approach.readings(steps) for approach in approaches])
    falls = np.maximum.accumulate(readings, axis=1) - readings
    return Extremes(len(approaches), float(falls.max()), float(readings[:, -1].min()))

"""Readings while a thing approaches the bone below a taxel, over shapes, sizes and angles."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from veca_marl.fidelity.touch.flat_skin import FlatSkin, Thing
from veca_marl.sim.geometry import Floats, Shape, pyramid

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

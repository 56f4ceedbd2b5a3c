"""One taxel on flat skin over flat bone, read by the kernel of the sense of touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats, Geom, Polyhedron, Scene, Shape
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
        self._fields = Fields(np.full((2, 1), radius_m), np.full(2, radius_m), skin.id)
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

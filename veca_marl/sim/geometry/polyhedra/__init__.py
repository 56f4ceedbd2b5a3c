"""Convex polyhedra: as data, as rows for compiled loops, and solids of that kind by name."""

from veca_marl.sim.geometry.polyhedra.polyhedron import Polyhedron, convex_hull
from veca_marl.sim.geometry.polyhedra.solids import pyramid, sector_of_disc
from veca_marl.sim.geometry.polyhedra.table import FACE_COLUMNS, face_rows

__all__ = [
    "FACE_COLUMNS",
    "Polyhedron",
    "convex_hull",
    "face_rows",
    "pyramid",
    "sector_of_disc",
]

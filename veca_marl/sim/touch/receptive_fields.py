"""The receptive fields of the taxels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.touch.taxels import TaxelTable


class Fields(NamedTuple):
    """The receptive fields of the taxels of a body.

    Attributes:
        radii: ``(2, T)`` metres, of the taxels of each triangle: first for all primitives but those
            of the own body, then for those.
        largest: ``(B + 1,)`` metres, the largest on each bone and, last, on the body.
        body: Id of the own body among the objects of the scene.
    """

    radii: Floats
    largest: Floats
    body: int


def fields_of(taxels: TaxelTable, share: float, body: int, points: Bools | None = None) -> Fields:
    """Return receptive fields with radii of a share of the gaps between taxels.

    Args:
        taxels: The taxels.
        share: Of `TaxelTable.gaps`.
        body: Id of the own body.
        points: ``(T,)`` triangles that sense the own body without a field; None for no triangle.
    """
    radii = np.tile(share * taxels.gaps, (2, 1))
    if points is not None:
        radii[1, points] = 0.0
    largest = np.maximum.reduceat(radii[0], taxels.first_triangle[:-1])
    return Fields(radii, np.append(largest, radii.max()), body)

"""The section of touch: laws of the reading, pokes by region, and their plots."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from veca_marl.fidelity.law import Curve, Law, Mark, Plot, Section, at_least, at_most
from veca_marl.fidelity.touch.approaches import SHAPES, Approach, all_approaches, extremes
from veca_marl.fidelity.touch.flat_skin import FlatSkin, Thing
from veca_marl.fidelity.touch.pokes import REGIONS, noticed_pokes
from veca_marl.sim.geometry import Shape
from veca_marl.sim.touch import TouchCfg

_TEXT = """
A taxel reads the compression of the skin at its place, 0 without contact and 1 where an object
meets the bone; `docs/reference/touch.md` defines it.

- **Approaches**: a ball, box, cylinder or capsule of 3 to 40 mm moves on a straight line towards
  the bone below a taxel, on flat skin of 1.5, 4 and 10 mm, at 0 to 60 degrees to the normal and
  tilted by 0 to 75 degrees. The reading must not fall on the way, and must be 1 at the bone.
- **Planes**: under a large plane that is parallel to the skin the reading is depth over thickness
  (the paper's formula), at every depth and for every radius of the receptive field.
- **Pokes**: a fingertip presses end on at random points of the skin, by a quarter of the thickness
  of both skins. The share with a reading above 0.02 is counted.
"""
RADII = (0.5, 1.0, 2.0)
"""Radii of receptive fields as multiples of the thickness of the skin; on the body 0.3 to 1.1."""
_STEPS = 100
_POKES = 120
_DEPTH = 0.25
_POINTS = "points (receptive_field=0)"


def plane_error(radius: float) -> float:
    """Return the largest difference from depth / thickness under a large plane, face on.

    Args:
        radius: Of the receptive field, as a multiple of the thickness of the skin.
    """
    errors = []
    for thickness_m in (0.0015, 0.004, 0.01):
        plane = Thing(Shape.BOX, (1.0, 1.0, 1.0), np.eye(3))
        skin = FlatSkin(thickness_m, radius * thickness_m, plane)
        for share in np.linspace(0.0, 1.3, 27):
            reading = skin.read(np.array([0.0, 0.0, 1.0 - share * thickness_m]))
            errors.append(abs(reading - min(share, 1.0)))
    return max(errors)


def laws() -> Iterator[Law]:
    """Yield the laws of approaches and planes."""
    for radius in RADII:
        approaches = list(all_approaches(np.random.default_rng(0), [radius]))
        found = extremes(approaches, _STEPS)
        on = f"{found.count} approaches, radius {radius:g} t"
        yield at_most(f"largest fall of T on the way, {on}", "", 1e-4, found.largest_fall)
        yield at_least(f"smallest T at the bone, {on}", "", 0.999, found.least_at_bone)
    for radius in (0.0, *RADII):
        name = f"largest |T - depth / t| under a plane, radius {radius:g} t"
        yield at_most(name, "", 1e-4, plane_error(radius))


def poke_shares(receptive_field: float, count: int) -> dict[str, float]:
    """Return the share of pokes that is noticed for each region of the body."""
    rng = np.random.default_rng(1)
    return {
        region: noticed_pokes(region, _DEPTH, count, receptive_field, rng).share
        for region in REGIONS
    }


def section() -> Section:
    """Return the measured section."""
    shares = poke_shares(TouchCfg().receptive_field, _POKES)
    everything = list(laws())
    everything += [
        at_least(f"share of noticed pokes, {region}", "", 0.95 if region in _FULL else 0.9, share)
        for region, share in shares.items()
    ]
    points = poke_shares(0.0, _POKES)
    pokes = Plot(
        "Noticed pokes of a fingertip",
        "region",
        "share",
        [
            Curve("receptive fields", list(shares), list(shares.values()), Mark.bars),
            Curve(_POINTS, list(points), list(points.values()), Mark.points),
        ],
    )
    return Section("Touch", _TEXT, everything, [_over_depth(), pokes])


_FULL = ("head", "trunk")  # the goal of 95 % is for these


def _over_depth() -> Plot:
    """Return T over depth for things of 10 mm on 10 mm of skin."""
    curves = []
    for shape in SHAPES:
        approach = Approach(shape, 0.01, 0.01, tilt_deg=20.0)
        readings = approach.readings(_STEPS)
        depth = 1.0 - approach.distances_m(_STEPS) / approach.skin_m
        curves.append(Curve(shape.name.lower(), depth.tolist(), readings.tolist()))
    return Plot("T over depth, 10 mm things", "depth of the foremost point / t", "T", curves)

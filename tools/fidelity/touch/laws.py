"""The section of touch: laws of the reading, pokes by region, and their plots."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_least, at_most
from tools.fidelity.touch.bare_body import BONES, noticed_pokes, threshold_m
from tools.fidelity.touch.fixed_arms import (
    DEFAULT_SHARE,
    clocks,
    impact_laws,
    impact_plot,
    impacts,
    readings_at_rest,
    rest_laws,
)
from tools.fidelity.touch.flat_skin import (
    SHAPES,
    Approach,
    FlatSkin,
    Thing,
    all_approaches,
    extremes,
)
from veca_marl.sim.geometry import Shape
from veca_marl.sim.touch import TouchCfg

_TEXT = """
A taxel reads the compression of the skin at its position, 0 without contact and 1 where an object
meets the bone; `docs/reference/touch.md` defines it.

- **Approaches**: a ball, box, cylinder or capsule of 3 to 40 mm moves on a straight line towards
  the bone below a taxel, on flat skin of 1.5, 4 and 10 mm, at 0 to 60 degrees to the normal and
  tilted by 0 to 75 degrees. The reading must not fall during the approach, and must be 1 at
  the bone.
- **Planes**: under a large plane that is parallel to the skin the reading is depth over thickness
  (the paper's formula), at every depth and for every radius of the receptive field.
- **Pokes**: a fingertip presses end on at random points of the skin, by a quarter of the thickness
  of both skins. The fraction with a reading above 0.02 is counted.
- **Two points**: two balls of 3 mm press by half of the skin. The threshold is the distance at
  which three quarters of the pairs cause two maxima of the readings with a gap between them.
  Values of adults: S. Weinstein in "The Skin Senses", ed. D. R. Kenshalo (1968), rounded.
- **Time steps**: balls of 0.05 to 1.5 kg rest on the palm and on the forearm of a body with fixed
  arms, at physics steps of 8, 4, 2 and 1 ms; a ball of 0.2 kg falls on them. The ratio of the
  largest and the smallest reading over the steps is 1 in theory. The peak of a fall of 20 mm on
  the palm depends on the step with the default `clock.contact_share` (plot), see
  `docs/reference/touch.md`.
"""
RADII = (0.5, 1.0, 2.0)
"""Radii of receptive fields as multiples of the thickness of the skin; on the body 0.3 to 1.1."""
_STEPS = 100
_POKES = 480
_DEPTH = 0.25
_LEAST_NOTICED = 0.95
_PAIRS = 24
ADULT_MM = {
    "l_index_distal": 2.5,
    "l_hand": 10.0,
    "head": 15.0,
    "l_forearm": 35.0,
    "l_upper_arm": 39.0,
    "spine": 39.0,
    "l_thigh": 42.0,
    "l_shank": 45.0,
    "l_foot": 20.0,
}
"""Two-point thresholds of adults in mm, of finger, palm, forehead, forearm, upper arm, back, thigh,
calf and foot (Weinstein 1968, rounded)."""


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
            errors.append(abs(float(reading) - min(float(share), 1.0)))
    return max(errors)


def laws() -> Iterator[Law]:
    """Yield the laws of approaches and planes."""
    for radius in RADII:
        approaches = list(all_approaches(np.random.default_rng(0), [radius]))
        found = extremes(approaches, _STEPS)
        on = f"{found.count} approaches, radius {radius:g} t"
        yield at_most(f"largest fall of T during the approach, {on}", "", 1e-4, found.largest_fall)
        yield at_least(f"smallest T at the bone, {on}", "", 0.999, found.least_at_bone)
    for radius in (0.0, *RADII):
        name = f"largest |T - depth / t| under a plane, radius {radius:g} t"
        yield at_most(name, "", 1e-4, plane_error(radius))


def poke_shares(receptive_field: float, count: int) -> dict[str, float]:
    """Return the share of pokes that is noticed on each bone."""
    rng = np.random.default_rng(1)
    return {bone: noticed_pokes(bone, _DEPTH, count, receptive_field, rng).share for bone in BONES}


def section() -> Section:
    """Return the measured section."""
    shares = poke_shares(TouchCfg().receptive_field, _POKES)
    everything = list(laws())
    everything += [
        at_least(f"fraction of noticed pokes, {bone}", "", _LEAST_NOTICED, share)
        for bone, share in shares.items()
    ]
    resolution = two_point_thresholds_mm(_PAIRS)
    everything.append(
        at_most(
            "two-point threshold of the palm over that of the back (adults: 0.26)",
            "",
            0.7,
            resolution["l_hand"] / resolution["spine"],
        )
    )
    falls = impacts()
    everything += [*rest_laws(readings_at_rest(clocks(DEFAULT_SHARE))), *impact_laws(falls)]
    plots = [
        _over_depth(),
        _pokes(shares, poke_shares(0.0, _POKES)),
        _thresholds(resolution),
        impact_plot(falls),
    ]
    return Section("Touch", _TEXT, everything, plots)


def two_point_thresholds_mm(count: int) -> dict[str, float]:
    """Return the two-point threshold of the bones for which an adult's is known."""
    rng = np.random.default_rng(2)
    return {bone: 1000.0 * threshold_m(bone, count, rng) for bone in ADULT_MM}


def _pokes(fields: dict[str, float], points: dict[str, float]) -> Plot:
    """Return the share of noticed pokes over bones."""
    curves = [
        Curve("receptive fields", list(fields), list(fields.values()), Mark.bars),
        Curve("points (receptive_field=0)", list(points), list(points.values()), Mark.points),
    ]
    return Plot("Noticed pokes of a fingertip", "bone", "share", curves)


def _thresholds(measured: dict[str, float]) -> Plot:
    """Return the two-point thresholds over bones, beside those of adults."""
    curves = [
        Curve("taxels", list(measured), list(measured.values()), Mark.bars),
        Curve("adults (Weinstein 1968)", list(ADULT_MM), list(ADULT_MM.values()), Mark.points),
    ]
    return Plot("Two-point threshold", "bone", "distance (mm)", curves)


def _over_depth() -> Plot:
    """Return T over depth for things of 10 mm on 10 mm of skin."""
    curves = []
    for shape in SHAPES:
        approach = Approach(shape, 0.01, 0.01, tilt_deg=20.0)
        readings = approach.readings(_STEPS)
        depth = 1.0 - approach.distances_m(_STEPS) / approach.skin_m
        curves.append(Curve(shape.name.lower(), depth.tolist(), readings.tolist()))
    return Plot("T over depth, 10 mm things", "depth of the foremost point / t", "T", curves)

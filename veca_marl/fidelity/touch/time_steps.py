"""Readings of touch over physics steps of 8 to 1 ms, at rest and at impacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from veca_marl.fidelity.law import Curve, Law, Mark, Plot, at_most
from veca_marl.fidelity.touch.fixed_arms import FOREARM, PALM, Ball, FixedArms, Spot
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import ClockCfg

MASSES_KG = (0.05, 0.2, 0.5, 1.5)
SPOTS = {"palm": PALM, "forearm": FOREARM}
DEFAULT_SHARE, LARGE_SHARE = 0.02, 0.1
"""Values of `ClockCfg.contact_share`, which is how early Bullet detects a contact."""
SLOW_FALL_M = 0.002
_SUBSTEPS = (5, 10, 20, 40)
_AT_REST_AFTER_S = 0.8


def clocks(contact_share: float) -> list[ClockCfg]:
    """Return clocks with physics steps of 8, 4, 2 and 1 ms."""
    return [ClockCfg(substeps=substeps, contact_share=contact_share) for substeps in _SUBSTEPS]


def readings_at_rest(clocks: Sequence[ClockCfg]) -> dict[str, Floats]:
    """Return the largest reading under balls of `MASSES_KG` at rest, ``(clocks, masses)``.

    Returns:
        The readings on each of `SPOTS`.
    """
    balls = [Ball(mass_kg) for mass_kg in MASSES_KG]
    rows: dict[str, list[list[float]]] = {name: [] for name in SPOTS}
    for clock in clocks:
        arms = FixedArms(clock, *balls)
        for name, spot in SPOTS.items():
            rows[name].append([_at_rest(arms, spot, ball) for ball in balls])
        arms.world.close()
    return {name: np.array(row) for name, row in rows.items()}


def _at_rest(arms: FixedArms, spot: Spot, ball: Ball) -> float:
    arms.press(_AT_REST_AFTER_S, 0.0, (spot, ball), watch=False)
    return arms.largest(spot.bone)


def peaks(
    spot: Spot, ball: Ball, clocks: Sequence[ClockCfg], fall_m: float = 0.02
) -> tuple[Floats, Floats]:
    """Return the peaks of touch and of force (N) of a fall, for each clock."""
    falls = []
    for clock in clocks:
        arms = FixedArms(clock, ball)
        falls += arms.press(0.2, fall_m, (spot, ball))
        arms.world.close()
    return (
        np.array([fall.touch.max() for fall in falls]),
        np.array([fall.force_n.max() for fall in falls]),
    )


def spread(readings: Floats) -> float:
    """Return the largest ratio of readings at different physics steps, ``(clocks, ...)``."""
    return float((readings.max(axis=0) / readings.min(axis=0)).max())


def rest_laws(readings: dict[str, Floats]) -> Iterator[Law]:
    """Yield the laws that readings at rest do not depend on the physics step."""
    for name, of_spot in readings.items():
        law = f"T at rest on the {name}, 0.05 to 1.5 kg: largest ratio over steps of 8 to 1 ms"
        yield at_most(law, "", 1.01, spread(of_spot))


def impacts() -> dict[str, Floats]:
    """Return the peaks of T of a ball of 0.2 kg that falls on the skin, at each physics step."""
    default, large = clocks(DEFAULT_SHARE), clocks(LARGE_SHARE)
    return {
        "palm, fall of 2 mm": peaks(PALM, Ball(), default, SLOW_FALL_M)[0],
        "palm, fall of 20 mm, contact_share=0.1": peaks(PALM, Ball(), large)[0],
        "forearm (rigid), fall of 20 mm": peaks(FOREARM, Ball(), default)[0],
        "palm, fall of 20 mm": peaks(PALM, Ball(), default)[0],
    }


LIMITS = {
    "palm, fall of 2 mm": 1.2,
    "palm, fall of 20 mm, contact_share=0.1": 1.4,
    "forearm (rigid), fall of 20 mm": 1.05,
}
"""Largest ratios of peaks; a fall of 20 mm on the palm at the default `contact_share` has none."""


def impact_laws(found: dict[str, Floats]) -> Iterator[Law]:
    """Yield the laws of the peaks of `impacts`."""
    for name, limit in LIMITS.items():
        law = f"peak of T, {name}: largest ratio over steps of 8 to 1 ms"
        yield at_most(law, "", limit, spread(found[name]))


def impact_plot(found: dict[str, Floats]) -> Plot:
    """Return the peaks of `impacts` over the physics step."""
    step_ms = [1000.0 * clock.substep_s for clock in clocks(DEFAULT_SHARE)]
    curves = [Curve(name, step_ms, peak.tolist(), Mark.line) for name, peak in found.items()]
    return Plot(
        "Peak of T of a ball of 0.2 kg", "physics step (ms)", "peak of T", curves, log_x=True
    )

"""Readings of taxels with lines that show them: the paper's `getTactile`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.touch.taxels import load_taxels, taxel_positions
from veca_marl.sim.touch.touch_sense import TouchSense

LINE_M = 0.05
"""Length of the debug line of a taxel that reads 1; the value is ours."""


class Tactile(NamedTuple):
    """Readings of the taxels of a body.

    Attributes:
        readings: ``(9888,)`` in [0, 1], see `TouchSense`; 0 for disabled taxels.
        lines: ``(n, 2, 3)`` metres, world frame: the debug lines of the enabled taxels with a
            reading above 0, from the taxel along the direction in which it is pressed, with a
            length in proportion to the reading. Empty without `debug`.
    """

    readings: Floats
    lines: Floats


def get_tactile(sense: TouchSense, taxel_ratio: float = 1.0, debug: bool = False) -> Tactile:
    """Return the present readings of the taxels of a body, whatever the quality of its touch.

    The paper draws a blue line for each taxel, and disables a share of the taxels so that the
    lines do not hide the body; `veca_marl.envs.rendering.draw_tactile_lines` draws these.

    Args:
        sense: The sense of touch of the body.
        taxel_ratio: Share of the taxels that are enabled, in [0, 1], evenly spaced in their order.
        debug: Whether to compute the lines.

    Raises:
        ValueError: If the ratio is not in [0, 1].
    """
    if not 0.0 <= taxel_ratio <= 1.0:
        raise ValueError(f"taxel_ratio={taxel_ratio} must be in [0, 1]")
    readings = sense.update_taxels().ravel().copy()
    readings[~_enabled(readings.size, taxel_ratio)] = 0.0
    return Tactile(readings, _lines(sense, readings) if debug else np.zeros((0, 2, 3)))


def _enabled(count: int, ratio: float) -> Bools:
    """Return a mask ``(count,)`` of `ratio` of the elements, evenly spaced."""
    before: Floats = np.floor(np.arange(count + 1) * ratio + 1e-9)
    enabled: Bools = np.diff(before) > 0.0
    return enabled


def _lines(sense: TouchSense, readings: Floats) -> Floats:
    """Return the lines ``(n, 2, 3)`` of all taxels with a reading above 0."""
    taxels = load_taxels()
    positions, normals = taxel_positions(taxels, sense.skin_vertices())
    pressed = np.flatnonzero(readings)
    starts = positions.reshape(-1, 3)[pressed]
    inward = -normals[pressed // positions.shape[1]]
    return np.stack([starts, starts + LINE_M * readings[pressed, None] * inward], axis=1)

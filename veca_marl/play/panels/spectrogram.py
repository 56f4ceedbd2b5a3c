"""Spectrograms of the last second at both ears."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.play.panels.drawing import Image, absent, titled

TITLES = ("left ear", "right ear")
# log10 magnitudes of the darkest and the brightest colour; a full-scale sine is 2.7
_DARK, _BRIGHT = -2.0, 2.0


def spectrograms(
    spectra: Sequence[NDArray[Any]], columns: int, height: int, width: int
) -> list[Image]:
    """Return the spectrograms of the left and the right ear, ``(height, width, 3)`` uint8 each.

    Time runs to the right and ends with the present step, frequency runs upwards.

    Args:
        spectra: One array ``(2, bins)`` per step, the observation `audio`, the present one last.
            Without any the panels state that the agent does not hear.
        columns: Number of steps that are shown; earlier ones are left out, missing ones dark.
        height: Height of a panel in pixels.
        width: Width of a panel in pixels.
    """
    if not spectra:
        return [absent(height, width, f"{title}: no hearing") for title in TITLES]
    recent = np.array(spectra[-columns:])
    shown = np.full((columns, *recent.shape[1:]), _DARK)
    shown[columns - len(recent) :] = recent
    return [
        titled(_coloured(shown[:, ear].T[::-1], height, width), title)
        for ear, title in enumerate(TITLES)
    ]


def _coloured(magnitudes: NDArray[Any], height: int, width: int) -> Image:
    """Return log magnitudes ``(bins, columns)``, the highest frequency first, as an image."""
    shares = ((magnitudes - _DARK) / (_BRIGHT - _DARK)).clip(0.0, 1.0)
    grey = np.round(255.0 * shares).astype(np.uint8)
    large = cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST)
    bgr = cv2.applyColorMap(large, cv2.COLORMAP_INFERNO)
    return np.ascontiguousarray(bgr[..., ::-1])

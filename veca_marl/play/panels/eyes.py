"""The images of both eyes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.play.panels.drawing import Image, absent, blank, titled

TITLES = ("left eye", "right eye")


def eye_panels(observation: Mapping[str, NDArray[Any]], size: int) -> list[Image]:
    """Return the images of the left and the right eye, each ``(size, size, 3)`` uint8.

    Args:
        observation: An observation; `vision` is ``(2, 3, H, W)`` uint8. Without it the panels
            state that the agent has no vision.
        size: Height and width of a panel. Images keep their ratio of height and width.
    """
    if "vision" not in observation:
        return [absent(size, size, f"{title}: no vision") for title in TITLES]
    eyes = observation["vision"]
    return [titled(_fitted(eye, size), title) for eye, title in zip(eyes, TITLES, strict=True)]


def _fitted(eye: NDArray[np.uint8], size: int) -> Image:
    """Enlarge ``(3, H, W)`` into the middle of a square panel by nearest neighbours."""
    picture = np.ascontiguousarray(np.moveaxis(eye, 0, -1))
    scale = size / max(picture.shape[:2])
    width, height = (max(round(scale * n), 1) for n in picture.shape[1::-1])
    large = cv2.resize(picture, (width, height), interpolation=cv2.INTER_NEAREST)
    panel = blank(size, size)
    top, left = (size - height) // 2, (size - width) // 2
    panel[top : top + height, left : left + width] = large
    return panel

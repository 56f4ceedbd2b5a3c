"""Colours and text of the panels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

BACKGROUND: Colour = (33, 36, 43)
TEXT: Colour = (225, 225, 220)
FAINT: Colour = (140, 144, 150)
LINE_HEIGHT = 18
_FONT, _SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.45


def blank(height: int, width: int) -> Image:
    """Return an image ``(height, width, 3)`` in the colour of the background."""
    return np.full((height, width, 3), BACKGROUND, np.uint8)


def write(image: Image, text: str, x: int, y: int, colour: Colour = TEXT) -> None:
    """Draw a line of text into an image.

    Args:
        image: ``(H, W, 3)`` uint8, contiguous.
        text: The text; characters that are not ASCII are drawn as question marks.
        x: Column of its left end.
        y: Row of its base line.
        colour: Red, green, blue.
    """
    cv2.putText(image, text, (x, y), _FONT, _SIZE, colour, 1, cv2.LINE_AA)


def titled(image: Image, title: str) -> Image:
    """Write a title into the upper left corner of an image and return it."""
    write(image, title, 7, 17, (0, 0, 0))  # a shadow keeps it readable on every picture
    write(image, title, 6, 16)
    return image


def absent(height: int, width: int, text: str) -> Image:
    """Return an empty panel that states what is not observed."""
    image = blank(height, width)
    write(image, text, 12, height // 2, FAINT)
    return image

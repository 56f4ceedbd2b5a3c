"""A panel of text."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.play.panels.drawing import LINE_HEIGHT, TEXT, Colour, Image, blank, write


def text_panel(lines: Sequence[str], height: int, width: int, colour: Colour = TEXT) -> Image:
    """Return a panel ``(height, width, 3)`` uint8 with lines of text; what is below is left out."""
    image = blank(height, width)
    for row, line in enumerate(lines):
        write(image, line, 6, LINE_HEIGHT * (row + 1) - 2, colour)
    return image

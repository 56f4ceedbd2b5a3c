"""The terms of the reward as bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from veca_marl.play.panels.drawing import FAINT, LINE_HEIGHT, Colour, Image, blank, titled, write

GAIN: Colour = (90, 190, 110)
LOSS: Colour = (215, 90, 80)


class TermBar(NamedTuple):
    """One term of the reward.

    Attributes:
        name: Its name.
        now: Its part of the reward of this step, weight included.
        total: The sum of these since the start of the episode.
        largest: The greatest absolute value of a step so far; the length of a full bar.
    """

    name: str
    now: float
    total: float
    largest: float


def reward_bars(bars: Sequence[TermBar], height: int, width: int) -> Image:
    """Return a panel ``(height, width, 3)`` uint8 with a bar, two numbers and a name per term.

    A bar begins in the middle and grows to the right for a positive part of the reward, to the left
    for a negative one. Terms that do not fit are left out.
    """
    image = titled(blank(height, width), "reward terms")
    write(image, "this step    episode", width - 168, 16, FAINT)
    rows = (height - LINE_HEIGHT) // LINE_HEIGHT - 1
    for row, bar in enumerate(bars[:rows]):
        _draw(image, bar, 2 * LINE_HEIGHT + row * LINE_HEIGHT, width)
    return image


def _draw(image: Image, bar: TermBar, base: int, width: int) -> None:
    write(image, bar.name, 6, base)
    write(image, f"{bar.now:9.4f}", width - 168, base)
    write(image, f"{bar.total:9.3f}", width - 82, base)
    middle, reach = width // 2 - 6, width // 2 - 174
    length = round(reach * bar.now / bar.largest) if bar.largest > 0.0 else 0
    left, right = sorted((middle, middle + length))
    image[base - 11 : base + 1, left : right + 1] = GAIN if bar.now > 0.0 else LOSS
    image[base - 13 : base + 3, middle] = FAINT

"""Panels of a film: images of what an agent senses, of its rewards, and lines of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering.skin_views import touch_image, touch_readings
from veca_marl.sim.geometry import Scene, SceneObject

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

BACKGROUND: Colour = (33, 36, 43)
TEXT: Colour = (225, 225, 220)
FAINT: Colour = (140, 144, 150)
LINE_HEIGHT = 18
"""Rows of a line of text in a picture of 720 rows."""
_FONT, _SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.45


def blank(height: int, width: int) -> Image:
    """Return an image ``(height, width, 3)`` in the colour of the background."""
    return np.full((height, width, 3), BACKGROUND, np.uint8)


def write(
    image: Image, text: str, x: float, y: float, colour: Colour = TEXT, scale: float = 1.0
) -> None:
    """Draw a line of text into an image.

    Args:
        image: ``(H, W, 3)`` uint8, contiguous.
        text: The text; characters that are not ASCII are drawn as question marks.
        x: Column of its left end.
        y: Row of its base line.
        colour: Red, green, blue.
        scale: Size of the text and of x and y, as a multiple of that in a picture of 720 rows.
    """
    place, thick = (round(scale * x), round(scale * y)), max(round(scale), 1)
    cv2.putText(image, text, place, _FONT, _SIZE * scale, colour, thick, cv2.LINE_AA)


def titled(image: Image, title: str, scale: float = 1.0) -> Image:
    """Write a title into the upper left corner of an image and return it."""
    write(image, title, 7, 17, (0, 0, 0), scale)  # a shadow keeps it readable on every picture
    write(image, title, 6, 16, TEXT, scale)
    return image


EYE_TITLES = ("left eye", "right eye")


def eye_panels(
    observation: Mapping[str, NDArray[Any]], width: int, scale: float = 1.0
) -> list[Image]:
    """Return the images of the left and the right eye, `width` wide, in the ratio of the eyes'.

    Args:
        observation: An observation; `vision` is ``(2, 3, H, W)`` uint8. Without it there are no
            panels.
        width: Width of a panel.
        scale: Size of the text.
    """
    if "vision" not in observation:
        return []
    eyes = observation["vision"]
    return [
        titled(_enlarged(eye, width), title, scale)
        for eye, title in zip(eyes, EYE_TITLES, strict=True)
    ]


def _enlarged(eye: NDArray[np.uint8], width: int) -> Image:
    """Enlarge ``(3, H, W)`` by nearest neighbours."""
    picture = np.ascontiguousarray(np.moveaxis(eye, 0, -1))
    height = max(round(width * picture.shape[0] / picture.shape[1]), 1)
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_NEAREST))


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


def reward_bars(bars: Sequence[TermBar], height: int, width: int, scale: float = 1.0) -> Image:
    """Return a panel ``(height, width, 3)`` uint8 with a bar, two numbers and a name per term.

    A bar lies under its term; it begins in the middle and grows to the right for a positive part of
    the reward, to the left for a negative one. Terms that do not fit are left out.
    """
    image = titled(blank(height, width), "reward terms", scale)
    write(image, "this step  episode", width / scale - 156, 16, FAINT, scale)
    rows = int(height / scale / LINE_HEIGHT - 1.3)
    for row, bar in enumerate(bars[: max(rows, 0)]):
        _draw(image, bar, (row + 2.1) * LINE_HEIGHT, scale)
    return image


def _draw(image: Image, bar: TermBar, base: float, scale: float) -> None:
    width = image.shape[1]
    middle, reach = width // 2, width // 2 - round(6 * scale)
    length = round(reach * bar.now / bar.largest) if bar.largest > 0.0 else 0
    left, right = sorted((middle, middle + length))
    top, end = round((base - 13) * scale), round((base + 3) * scale)
    image[top:end, left : right + 1] = GAIN if bar.now > 0.0 else LOSS
    image[top:end, middle] = FAINT
    right_end = width / scale
    write(image, bar.name, 6, base, TEXT, scale)
    write(image, f"{bar.now:9.4f}", right_end - 156, base, TEXT, scale)
    write(image, f"{bar.total:9.3f}", right_end - 80, base, TEXT, scale)


def skin_panel(
    scene: Scene,
    body: SceneObject,
    observation: Mapping[str, NDArray[Any]],
    height: int,
    scale: float = 1.0,
) -> Image | None:
    """Return front and back of a body, ``(height, 4/3 height, 3)`` uint8.

    Each taxel is coloured by its reading (observation `touch`), or each part of the skin by the
    greatest reading in it (`touch_parts`).

    Args:
        scene: The scene.
        body: The body.
        observation: Its observation.
        height: Height of the panel in pixels.
        scale: Size of the text.

    Returns:
        The panel; None without touch.
    """
    readings = touch_readings(observation)
    if readings is None:
        return None
    panel = np.ascontiguousarray(touch_image(scene, body, readings, height))
    largest = readings.max(initial=0.0)
    return titled(panel, f"skin, front and back; greatest {largest:.2f}", scale)


EAR_TITLES = ("left ear", "right ear")
# log10 magnitudes of the darkest and the brightest colour; a full-scale sine is 2.7
_DARK, _BRIGHT = -2.0, 2.0


def spectrograms(
    spectra: Sequence[NDArray[Any]], columns: int, height: int, width: int, scale: float = 1.0
) -> list[Image]:
    """Return the spectrograms of the left and the right ear, ``(height, width, 3)`` uint8 each.

    Time runs to the right and ends with the present step, frequency runs upwards.

    Args:
        spectra: One array ``(2, bins)`` of log10 of magnitudes per step, the present one last.
            Without any there are no panels.
        columns: Number of steps that are shown; earlier ones are left out, missing ones dark.
        height: Height of a panel in pixels.
        width: Width of a panel in pixels.
        scale: Size of the text.
    """
    if not spectra:
        return []
    recent = np.array(spectra[-columns:])
    shown = np.full((columns, *recent.shape[1:]), _DARK)
    shown[columns - len(recent) :] = recent
    return [
        titled(_coloured(shown[:, ear].T[::-1], height, width), title, scale)
        for ear, title in enumerate(EAR_TITLES)
    ]


def _coloured(magnitudes: NDArray[Any], height: int, width: int) -> Image:
    """Return log magnitudes ``(bins, columns)``, the highest frequency first, as an image."""
    fractions = ((magnitudes - _DARK) / (_BRIGHT - _DARK)).clip(0.0, 1.0)
    grey = np.round(255.0 * fractions).astype(np.uint8)
    large = cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST)
    bgr = cv2.applyColorMap(large, cv2.COLORMAP_INFERNO)
    return np.ascontiguousarray(bgr[..., ::-1])


def text_panel(lines: Sequence[str], height: int, width: int, scale: float = 1.0) -> Image:
    """Return a panel ``(height, width, 3)`` uint8 with lines of text; what is below is left out."""
    image = blank(height, width)
    for row, line in enumerate(lines):
        write(image, line, 6, LINE_HEIGHT * (row + 1) - 2, TEXT, scale)
    return image

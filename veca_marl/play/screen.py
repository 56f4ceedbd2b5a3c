"""The whole picture: the room, both eyes, both ears, the skin, the reward and a few lines."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering import RoomView, touch_image, touch_readings
from veca_marl.play.session import Moment, Session
from veca_marl.sim.geometry import Scene, SceneObject
from veca_marl.sim.hearing import AudioSense

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


EYE_TITLES = ("left eye", "right eye")


def eye_panels(observation: Mapping[str, NDArray[Any]], size: int) -> list[Image]:
    """Return the images of the left and the right eye, each ``(size, size, 3)`` uint8.

    Args:
        observation: An observation; `vision` is ``(2, 3, H, W)`` uint8. Without it the panels
            state that the agent has no vision.
        size: Height and width of a panel. Images keep their ratio of height and width.
    """
    if "vision" not in observation:
        return [absent(size, size, f"{title}: no vision") for title in EYE_TITLES]
    eyes = observation["vision"]
    return [titled(_fitted(eye, size), title) for eye, title in zip(eyes, EYE_TITLES, strict=True)]


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


def skin_panel(
    scene: Scene, body: SceneObject, observation: Mapping[str, NDArray[Any]], height: int
) -> Image:
    """Return front and back of a body, ``(height, 4/3 height, 3)`` uint8.

    Each taxel is coloured by its reading (observation `touch`), or each part of the skin by the
    greatest reading in it (`touch_parts`).

    Args:
        scene: The scene.
        body: The body.
        observation: Its observation; without touch the panel states that.
        height: Height of the panel in pixels.
    """
    readings = touch_readings(observation)
    if readings is None:
        return absent(height, 2 * (height * 2 // 3), "skin: no touch")
    panel = np.ascontiguousarray(touch_image(scene, body, readings, height))
    largest = readings.max(initial=0.0)
    return titled(panel, f"skin, front and back; greatest reading {largest:.2f}")


EAR_TITLES = ("left ear", "right ear")
# log10 magnitudes of the darkest and the brightest colour; a full-scale sine is 2.7
_DARK, _BRIGHT = -2.0, 2.0


def spectrograms(
    spectra: Sequence[NDArray[Any]], columns: int, height: int, width: int
) -> list[Image]:
    """Return the spectrograms of the left and the right ear, ``(height, width, 3)`` uint8 each.

    Time runs to the right and ends with the present step, frequency runs upwards.

    Args:
        spectra: One array ``(2, bins)`` of log10 of magnitudes per step, the present one last.
            Without any the panels state that the agent does not hear.
        columns: Number of steps that are shown; earlier ones are left out, missing ones dark.
        height: Height of a panel in pixels.
        width: Width of a panel in pixels.
    """
    if not spectra:
        return [absent(height, width, f"{title}: no hearing") for title in EAR_TITLES]
    recent = np.array(spectra[-columns:])
    shown = np.full((columns, *recent.shape[1:]), _DARK)
    shown[columns - len(recent) :] = recent
    return [
        titled(_coloured(shown[:, ear].T[::-1], height, width), title)
        for ear, title in enumerate(EAR_TITLES)
    ]


def _coloured(magnitudes: NDArray[Any], height: int, width: int) -> Image:
    """Return log magnitudes ``(bins, columns)``, the highest frequency first, as an image."""
    shares = ((magnitudes - _DARK) / (_BRIGHT - _DARK)).clip(0.0, 1.0)
    grey = np.round(255.0 * shares).astype(np.uint8)
    large = cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST)
    bgr = cv2.applyColorMap(large, cv2.COLORMAP_INFERNO)
    return np.ascontiguousarray(bgr[..., ::-1])


def text_panel(lines: Sequence[str], height: int, width: int, colour: Colour = TEXT) -> Image:
    """Return a panel ``(height, width, 3)`` uint8 with lines of text; what is below is left out."""
    image = blank(height, width)
    for row, line in enumerate(lines):
        write(image, line, 6, LINE_HEIGHT * (row + 1) - 2, colour)
    return image


WIDTH, HEIGHT = 1280, 720
_ROOM = (640, 480)  # width and height
_EYE, _EAR_HEIGHT, _LOW = 320, 160, 240
_BARS, _LINES = 480, 480


class Screen:
    """Draws moments of a session; it remembers the spectra of the last second.

    Args:
        session: The session.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._view = RoomView(session.game, *_ROOM)
        self._spectra: deque[NDArray[Any]] = deque(maxlen=session.steps_per_s)
        self._largest = dict.fromkeys(session.game.weights, 0.0)

    def add(self, moment: Moment) -> None:
        """Take note of a moment; call it once for each, also for those that are not drawn."""
        if moment.steps == 0:
            self._spectra.clear()
        ears = self._session.game.actors[0].senses.get("audio")
        if isinstance(ears, AudioSense):
            self._spectra.append(ears.log_magnitudes(moment.observation["audio"]))
        for name, value in moment.terms.items():
            self._largest[name] = max(self._largest[name], abs(value))

    def draw(self, moment: Moment, lines: Sequence[str]) -> Image:
        """Return the picture of the moment that was added last, ``(720, 1280, 3)`` uint8.

        Args:
            moment: The moment.
            lines: Text in the lower right corner, below the state of the episode.
        """
        game, seen = self._session.game, moment.observation
        body = game.world.scene.objects[game.actors[0].body.object_id]
        room = titled(self._view.image(), f"{game.cfg.task.name}: {game.actors[0].name}")
        ears = spectrograms(list(self._spectra), self._spectra.maxlen or 1, _EAR_HEIGHT, _EYE)
        sides = [np.concatenate(pair) for pair in zip(eye_panels(seen, _EYE), ears, strict=True)]
        low = [
            skin_panel(game.world.scene, body, seen, _LOW),
            reward_bars(self._bars(moment), _LOW, _BARS),
            text_panel([*self._state(moment), *lines], _LOW, _LINES),
        ]
        upper = np.concatenate([room, *sides], axis=1)
        picture: Image = np.concatenate([upper, np.concatenate(low, axis=1)])
        return picture

    def _bars(self, moment: Moment) -> list[TermBar]:
        return [
            TermBar(name, value, moment.sums[name], self._largest[name])
            for name, value in moment.terms.items()
        ]

    def _state(self, moment: Moment) -> list[str]:
        time_s = moment.steps * self._session.step_s
        state = [
            f"time {time_s:.2f} s, step {moment.steps} of {self._session.game.max_steps}",
            f"reward {sum(moment.terms.values()):.4f}, return {sum(moment.sums.values()):.3f}",
        ]
        ending = ["the episode has ended"] if moment.done else []
        if moment.solved is not None:
            ending.insert(0, "solved" if moment.solved else "not solved")
        return [*state, ", ".join(ending)]

"""The window and the loudspeaker. They need the extra ``[play]`` (pygame-ce)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from veca_marl.envs.rendering.film import FilmCfg, FilmQuality
from veca_marl.play.screen import Screen
from veca_marl.play.session import Session
from veca_marl.play.steering import Keyboard, gaze_point, steerable, steering_help
from veca_marl.runs.video import SAMPLE_RATE_HZ
from veca_marl.sim.body import Body

_PEAK = 0.8  # of full scale
_FULL_SCALE = 32_767
_SHORTEST_S = 0.12  # of a block: below, gaps between blocks are audible
_LONGEST_S = 1.0  # of sound that waits; older sound is dropped


class Loudspeaker:
    """Plays waveforms one after another, as long as they come in real time.

    All samples are scaled by one factor, which falls when a greater amplitude than before occurs.

    Args:
        sample_rate_hz: Samples per second.

    Raises:
        pygame.error: If there is no loudspeaker.
    """

    def __init__(self, sample_rate_hz: int) -> None:
        pygame.mixer.init(sample_rate_hz, -16, 2, 1024, allowedchanges=0)
        self._channel = pygame.mixer.Channel(0)
        self._rate_hz = sample_rate_hz
        self._waiting: NDArray[Any] = np.zeros((2, 0), np.float32)
        self._peak = 1e-3

    def add(self, waveform: NDArray[Any]) -> None:
        """Append the samples ``(2, n)`` of a step."""
        self._peak = max(self._peak, float(np.abs(waveform).max(initial=0.0)))
        waiting = np.concatenate((self._waiting, waveform), axis=1)
        self._waiting = waiting[:, -round(_LONGEST_S * self._rate_hz) :]
        enough = self._waiting.shape[1] >= _SHORTEST_S * self._rate_hz
        if enough and self._channel.get_queue() is None:
            self._channel.queue(pygame.mixer.Sound(buffer=pcm(self._waiting, self._peak)))
            self._waiting = self._waiting[:, :0]


def pcm(waveform: NDArray[Any], peak: float) -> bytes:
    """Return samples ``(2, n)`` as interleaved 16-bit integers, `peak` at 0.8 of full scale."""
    scaled = np.clip(waveform * (_PEAK / peak), -1.0, 1.0)
    return np.round(_FULL_SCALE * scaled.T).astype(np.int16).tobytes()


HELP = "p pause, r again, n next episode, escape quit"
_LEFT_BUTTON, _RIGHT_BUTTON = 1, 3
_WITHOUT_SCREEN = ("offscreen", "dummy")  # SDL's drivers that show nothing


class NoDisplayError(Exception):
    """There is no screen to open a window on."""


class Window:
    """Plays a session in a window, at the speed of its clock.

    An episode that has ended is followed by the next after a second.

    Attributes:
        episode: Number of the present episode.
        moment: The present moment.
        paused: Whether the simulation stands still.
        is_open: Whether the window is open.

    Args:
        session: What is played.
        title: Title of the window.
        keyboard: Receives the keys that steer the first actor; None if a policy plays it.
        sound: Whether the sound at the ears is played; without a loudspeaker it is not, and a line
            on the screen states that.
        cfg: What is shown; None is `FilmCfg()`.

    Raises:
        NoDisplayError: If there is no screen.
        ValueError: If there is no such agent.
    """

    def __init__(
        self,
        session: Session,
        title: str,
        keyboard: Keyboard | None = None,
        sound: bool = True,
        cfg: FilmCfg | None = None,
    ) -> None:
        self._session, self._keyboard = session, keyboard
        cfg = cfg or FilmCfg()
        is_auto = cfg.quality is FilmQuality.auto
        self._screen = Screen(session, replace(cfg, quality=FilmQuality.fast) if is_auto else cfg)
        self._size = cfg.width, cfg.height
        self._surface = _open(title, self._size)
        self._clock = pygame.time.Clock()
        steering = [] if keyboard is None else steering_help(steerable(self._body))
        self._lines = [title, *steering, HELP]
        self._loudspeaker = self._open_loudspeaker() if sound and session.hears else None
        self.paused, self.is_open = False, True
        self.begin(0)

    @property
    def _body(self) -> Body:
        """The body of the first actor: a game makes new ones when a simulation breaks down."""
        return self._session.game.actors[0].body

    def _open_loudspeaker(self) -> Loudspeaker | None:
        try:
            return Loudspeaker(SAMPLE_RATE_HZ)
        except pygame.error as error:
            self._lines.append(f"no sound: {error}")
            return None

    def __enter__(self) -> Window:
        """Return the window."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close window and loudspeaker."""
        pygame.quit()

    def begin(self, episode: int) -> None:
        """Begin the episode of a number."""
        self.episode = episode
        self._pointer: tuple[int, int] | None = None
        self._rest = self._session.steps_per_s
        if self._keyboard is not None:
            self._keyboard.release_all()
        self.moment = self._session.begin(episode)
        self._screen.add(self.moment)

    def run(self, episodes: int | None = None) -> None:
        """Play until the window is closed, or until so many episodes have ended."""
        while self.is_open and (episodes is None or self.episode < episodes):
            self.tick()
            self._clock.tick(self._session.steps_per_s)

    def tick(self) -> None:
        """Handle what happened since the last call, play a step and draw it."""
        for event in pygame.event.get():
            self._handle(event)
        if self.is_open and not self.paused:
            self._advance()
        self._draw()

    def _advance(self) -> None:
        if self.moment.done:
            self._rest -= 1
            if self._rest <= 0:
                self.begin(self.episode + 1)
            return
        self._look()
        self.moment = self._session.step()
        self._screen.add(self.moment)
        if self._loudspeaker is not None and "waveform" in self.moment.observation:
            self._loudspeaker.add(self.moment.observation["waveform"])

    def _look(self) -> None:
        """Turn the eyes to where the pointer was with the left button held."""
        if self._keyboard is not None and self._pointer is not None:
            right = 2.0 * self._pointer[0] / self._size[0] - 1.0
            down = 2.0 * self._pointer[1] / self._size[1] - 1.0
            self._body.look_toward_point(gaze_point(self._body, right, down))

    def _handle(self, event: pygame.event.Event) -> None:
        if event.type == pygame.QUIT:
            self.is_open = False
        elif event.type == pygame.KEYDOWN:
            self._press(pygame.key.name(event.key))
        elif event.type == pygame.KEYUP and self._keyboard is not None:
            self._keyboard.release(pygame.key.name(event.key))
        elif event.type == pygame.WINDOWFOCUSLOST and self._keyboard is not None:
            self._keyboard.release_all()
        else:
            self._point(event)

    def _press(self, key: str) -> None:
        if key == "escape":
            self.is_open = False
        elif key == "p":
            self.paused = not self.paused
        elif key in ("r", "n"):
            self.begin(self.episode + (key == "n"))
        elif self._keyboard is not None:
            self._keyboard.press(key)

    def _point(self, event: pygame.event.Event) -> None:
        """Follow the pointer while the left button is held; look ahead after the right one."""
        if event.type == pygame.MOUSEMOTION and event.buttons[0]:
            self._pointer = event.pos
        if event.type != pygame.MOUSEBUTTONDOWN:
            return
        if event.button == _LEFT_BUTTON:
            self._pointer = event.pos
        elif event.button == _RIGHT_BUTTON and self._keyboard is not None:
            self._pointer = None
            self._body.release_look()

    def _draw(self) -> None:
        lines: Sequence[str] = [f"episode {self.episode}", *self._lines]
        picture = self._screen.draw(self.moment, ["paused", *lines] if self.paused else lines)
        pygame.surfarray.blit_array(self._surface, picture.swapaxes(0, 1))
        pygame.display.flip()


def _open(title: str, size: tuple[int, int]) -> pygame.Surface:
    """Open the window.

    Raises:
        NoDisplayError: If there is no screen.
    """
    try:
        pygame.display.init()
        driver = pygame.display.get_driver()
        # without a screen SDL falls back to a driver that shows nothing
        if driver in _WITHOUT_SCREEN and os.environ.get("SDL_VIDEODRIVER") != driver:
            pygame.display.quit()  # another driver may be chosen later
            raise NoDisplayError("no display; video=FILE.mp4 writes a video instead")
        pygame.display.set_caption(title)
        return pygame.display.set_mode(size)
    except pygame.error as error:
        raise NoDisplayError(
            f"no window: {error}; video=FILE.mp4 writes a video instead"
        ) from error

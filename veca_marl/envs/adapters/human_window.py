"""The window of ``render_mode="human"``. It needs the extra ``[play]`` (pygame-ce)."""

from __future__ import annotations

import os
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

_WITHOUT_SCREEN = ("offscreen", "dummy")  # SDL's drivers that show nothing


class HumanWindow:
    """Shows pictures in a window, at most so many per second; it opens with the first picture.

    A person may close it: further pictures are then not shown.

    Args:
        title: Title of the window.
        fps: Pictures per second.

    Raises:
        ModuleNotFoundError: Without pygame.
    """

    def __init__(self, title: str, fps: int) -> None:
        self._pygame, self._title, self._fps = _import_pygame(), title, fps
        self._surface: Any = None
        self._clock = self._pygame.time.Clock()
        self.is_closed = False

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture ``(height, width, 3)`` uint8, and wait until the next one is due.

        Raises:
            RuntimeError: If there is no screen.
        """
        if self.is_closed:
            return
        pygame = self._pygame
        if self._surface is None:
            self._surface = self._opened(picture.shape[1], picture.shape[0])
        pygame.surfarray.blit_array(self._surface, picture.swapaxes(0, 1))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
        elif pygame.display.get_driver() not in _WITHOUT_SCREEN:  # nobody sees the speed
            self._clock.tick(self._fps)

    def _opened(self, width: int, height: int) -> Any:
        pygame = self._pygame
        try:
            pygame.display.init()
            driver = pygame.display.get_driver()
            # without a screen SDL falls back to a driver that shows nothing
            if driver in _WITHOUT_SCREEN and os.environ.get("SDL_VIDEODRIVER") != driver:
                pygame.display.quit()  # another driver may be chosen later
                raise RuntimeError(f"no display; {_INSTEAD}")
            pygame.display.set_caption(self._title)
            return pygame.display.set_mode((width, height))
        except pygame.error as error:
            raise RuntimeError(f"no window: {error}; {_INSTEAD}") from error

    def close(self) -> None:
        """Close the window."""
        if self._surface is not None:
            self._pygame.display.quit()
        self._surface, self.is_closed = None, True


_INSTEAD = "render_mode='rgb_array' returns the pictures instead"


def _import_pygame() -> ModuleType:
    try:
        return import_module("pygame")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"render_mode='human' needs pygame: pip install 'veca_marl[play]'; {_INSTEAD}",
            name=error.name,
        ) from error

"""The whole picture: the room, both eyes, both ears, the skin, the reward and a few lines."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering import RoomView
from veca_marl.play.panels.drawing import Image, titled
from veca_marl.play.panels.eyes import eye_panels
from veca_marl.play.panels.reward_bars import TermBar, reward_bars
from veca_marl.play.panels.skin import skin_panel
from veca_marl.play.panels.spectrogram import spectrograms
from veca_marl.play.panels.text_lines import text_panel
from veca_marl.play.session import Moment, Session

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
        if "audio" in moment.observation:
            self._spectra.append(moment.observation["audio"])
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

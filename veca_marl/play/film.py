"""Episodes as a video with the sound at the ears of the first actor."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.play.screen import HEIGHT, WIDTH, Screen
from veca_marl.play.session import Moment, Session
from veca_marl.runs.recording import SAMPLE_RATE_HZ
from veca_marl.runs.video import VideoFile


def film(path: Path, session: Session, episodes: int, title: str) -> list[float]:
    """Play whole episodes and write them one after another into one MP4 file.

    Args:
        path: The file.
        session: What is played.
        episodes: Number of episodes, from episode 0 on.
        title: A line of text in the picture.

    Returns:
        The return of each episode.
    """
    screen = Screen(session)
    rate_hz = SAMPLE_RATE_HZ if session.hears else None
    sound: list[NDArray[Any]] = []
    returns = []
    with VideoFile(path, (HEIGHT, WIDTH), session.steps_per_s, rate_hz) as file:
        for episode in range(episodes):
            for moment in _moments(session, episode):
                screen.add(moment)
                file.add_picture(screen.draw(moment, [title, f"episode {episode}"]))
                if "waveform" in moment.observation:
                    sound.append(moment.observation["waveform"])
            returns.append(sum(moment.sums.values()))
        if sound:
            file.add_sound(np.concatenate(sound, axis=1))
    return returns


def _moments(session: Session, episode: int) -> Iterator[Moment]:
    """Play an episode; return its moments without the start, one per step."""
    moment = session.begin(episode)
    while not moment.done:
        moment = session.step()
        yield moment

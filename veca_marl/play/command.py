"""Play or watch a game: ``python -m veca_marl.play +task=KickTheBall``.

A window opens (extra ``[play]``) in which keys steer the first agent if it walks; with
``policy=expert``, ``policy=random`` or ``policy=runs/...`` that policy plays. With
``video=FILE.mp4`` no window opens, and whole episodes are written into a video. The picture shows
the room, both eyes, the spectra at both ears, the touched skin and the terms of the reward of the
first agent; the sound is that at its ears. A run is played on its stored configuration. With
``save=FILE.html`` one episode becomes a page that any browser opens from disk: the world in 3D, and
what each agent sees, hears, feels, does and is rewarded for on one time line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.evaluation.evaluate import Exploration
from veca_marl.algos.files import WriteError, write_errors
from veca_marl.config import ConfigError, one_line
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.envs.rendering.film import FilmCfg, shown_agents
from veca_marl.play.screen import Screen
from veca_marl.play.session import EXPERT, KEYBOARD, Choice, Moment, Session, choose
from veca_marl.play.steering import Keyboard, SteeredPolicy
from veca_marl.runs.episode_page import EpisodeRecorder, write_page
from veca_marl.runs.video import SAMPLE_RATE_HZ, VideoFile


def film(
    path: Path, session: Session, episodes: int, title: str, cfg: FilmCfg | None = None
) -> list[float]:
    """Play whole episodes and write them one after another into one MP4 file.

    Args:
        path: The file.
        session: What is played.
        episodes: Number of episodes, from episode 0 on.
        title: A line of text in the picture.
        cfg: How it is shown; None is `FilmCfg()`.

    Returns:
        The return of each episode.
    """
    cfg = cfg or FilmCfg()
    screen = Screen(session, cfg)
    rate_hz = SAMPLE_RATE_HZ if session.hears else None
    sound: list[NDArray[Any]] = []
    returns = []
    with VideoFile(path, (cfg.height, cfg.width), session.steps_per_s, rate_hz) as file:
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


def save(path: Path, session: Session, number: int, details: dict[str, object]) -> float:
    """Play a whole episode and write it as a page.

    Args:
        path: The file.
        session: What is played.
        number: Number of the episode, from 0 on.
        details: Lines of text on the page by name.

    Returns:
        The return of the first actor.
    """
    recorder = EpisodeRecorder(session.env)
    moment = session.begin(number)
    recorder.begin()
    while not moment.done:
        moment = session.step()
        recorder.add(session.played)
    title = session.env.cfg.task.name
    write_page(path, recorder.episode(title, details, SAMPLE_RATE_HZ))
    return sum(moment.sums.values())


def _moments(session: Session, episode: int) -> Iterator[Moment]:
    """Play an episode; return its moments without the start, one per step."""
    moment = session.begin(episode)
    while not moment.done:
        moment = session.step()
        yield moment


_ERRORS = (CheckpointError, WriteError, ModuleNotFoundError)


@dataclass
class PlayCfg(FilmCfg):
    """How a game is played and shown, see `FilmCfg`.

    Attributes:
        exploration: Whether policies take the mode of their distribution or a sample; None is as in
            the run (`eval.exploration`).
        sound: Whether the sound at the ears is played while the window is open.
    """

    exploration: Exploration | None = None
    sound: bool = True


@dataclass
class PlayOptions:
    """Options of the command.

    Attributes:
        policy: What plays: keyboard, expert, random, zoo/NAME, the folder of a run, or a checkpoint
            in it. None is the keyboard in a window and the expert in a file.
        video: MP4 file to write; without it and `save` a window opens.
        save: HTML file to write, an episode that any browser opens from disk.
        episodes: Number of episodes; None is one in a file, and any number in a window. A page
            shows the last of them.
        seed: Seed of the episodes.
        play: How it is played.
    """

    policy: str | None = None
    video: str | None = None
    save: str | None = None
    episodes: int | None = None
    seed: int = 1
    play: PlayCfg = field(default_factory=PlayCfg)

    def __post_init__(self) -> None:
        if self.episodes is not None and self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.video is not None and not self.video.endswith(".mp4"):
            raise ValueError(f"video={self.video}: must end in .mp4")
        if self.save is not None and not self.save.endswith(".html"):
            raise ValueError(f"save={self.save}: must end in .html")
        if self.save is not None and self.video is not None:
            raise ValueError(f"save={self.save} and video={self.video}: give one of them")
        for option, file in (("video", self.video), ("save", self.save)):
            if file is not None and self.policy == KEYBOARD:
                raise ValueError(f"policy={KEYBOARD} needs a window; leave out {option}={file}")


def run(options: PlayOptions, overrides: list[str]) -> None:
    """Play in a window, or write a video or a page."""
    torch.set_num_threads(1)
    if options.save is not None:
        _save(options, overrides, check_file(options.save, "save"))
    elif options.video is not None:
        _film(options, overrides, check_file(options.video, "video"))
    else:
        _play(options, overrides)


def _film(options: PlayOptions, overrides: list[str], path: Path) -> None:
    policy = options.policy or EXPERT
    session = _session(choose(policy, overrides), options)
    with write_errors(path):
        returns = film(path, session, options.episodes or 1, f"policy: {policy}", options.play)
    session.close()
    for episode, total in enumerate(returns):
        print(f"episode {episode}: return {total:.3f}")
    print(f"{path}: {len(returns)} episodes")


def _save(options: PlayOptions, overrides: list[str], path: Path) -> None:
    policy = options.policy or EXPERT
    session = _session(choose(policy, overrides), options)
    number = (options.episodes or 1) - 1
    details = {"policy": policy, "seed": options.seed, "episode": number}
    try:
        total = save(path, session, number, details)
    finally:
        session.close()
    print(f"episode {number}: return {total:.3f}")
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, opens in any browser")


def _play(options: PlayOptions, overrides: list[str]) -> None:
    window = _import_window()
    policy, keyboard = options.policy or KEYBOARD, Keyboard()
    choice = choose(policy, overrides, lambda env: SteeredPolicy(env, keyboard))
    session = _session(choice, options)
    steers = keyboard if policy == KEYBOARD else None
    try:
        title = f"policy: {policy}"
        with window.Window(session, title, steers, options.play.sound, options.play) as opened:
            opened.run(options.episodes)
    except window.NoDisplayError as error:
        raise ConfigError(str(error)) from error
    finally:
        session.close()


def _import_window() -> ModuleType:
    """Return the module of the window, which needs pygame.

    Raises:
        ModuleNotFoundError: Without the extra ``[play]``.
    """
    try:
        return import_module("veca_marl.play.window")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "a window needs pygame: pip install 'veca_marl[play]'; video=FILE.mp4 and "
            "save=FILE.html need none",
            name=error.name,
        ) from error


def _session(choice: Choice, options: PlayOptions) -> Session:
    exploration = options.play.exploration or choice.exploration
    try:
        session = Session(choice.cfg.game, choice.make_policy, options.seed, exploration)
        shown_agents(session.game, options.play.agent)
        return session
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("play", PlayOptions, str(__doc__), _ERRORS, outputs=("video", "save")).run(
        run, words
    )

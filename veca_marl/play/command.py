"""Watch a game: ``python -m veca_marl.play +task=KickTheBall policy=expert video=kick.mp4``.

The picture shows the room, both eyes, the spectra at both ears, the touched skin and the terms of
the reward of the first agent; the sound is that at its ears. ``policy`` is expert, random, the
folder of a run or a checkpoint in it; a run is played on its stored configuration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from omegaconf import MISSING

from veca_marl.algos.evaluation.evaluate import Exploration
from veca_marl.algos.files import WriteError, naming
from veca_marl.algos.training.checkpoint import CheckpointError
from veca_marl.config import ConfigError, one_line
from veca_marl.config.command_line import CommandLine
from veca_marl.play.film import film
from veca_marl.play.policies import EXPERT, Choice, choose
from veca_marl.play.session import Session

_ERRORS = (CheckpointError, WriteError)


@dataclass
class PlayCfg:
    """How a game is played.

    Attributes:
        exploration: Whether policies take the mode of their distribution or a sample; None is as in
            the run (`eval.exploration`).
    """

    exploration: Exploration | None = None


@dataclass
class PlayOptions:
    """Options of the command.

    Attributes:
        policy: What plays: expert, random, the folder of a run, or a checkpoint in it.
        video: The MP4 file that is written.
        episodes: Number of episodes in the video.
        seed: Seed of the episodes.
        play: How it is played.
    """

    policy: str = EXPERT
    video: str = MISSING
    episodes: int = 1
    seed: int = 1
    play: PlayCfg = field(default_factory=PlayCfg)

    def __post_init__(self) -> None:
        if self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if not self.video.endswith(".mp4"):
            raise ValueError(f"video={self.video}: must end in .mp4")


def run(options: PlayOptions, overrides: list[str]) -> None:
    """Play, and write the video."""
    torch.set_num_threads(1)
    choice = choose(options.policy, overrides)
    session = _session(choice, options)
    path = Path(options.video)
    with naming(path):
        returns = film(path, session, options.episodes, f"policy: {options.policy}")
    session.close()
    for episode, total in enumerate(returns):
        print(f"episode {episode}: return {total:.3f}")
    print(f"{path}: {len(returns)} episodes")


def _session(choice: Choice, options: PlayOptions) -> Session:
    exploration = options.play.exploration or choice.exploration
    try:
        return Session(choice.cfg.game, choice.make_policy, options.seed, exploration)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("play", PlayOptions, str(__doc__), _ERRORS).run(run, words)

"""Video of one episode: images and touch of an agent beside a view of the room, with its sound."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.algos.evaluation.evaluate import ActionPolicy
from veca_marl.algos.networks.memory import with_memory
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.runs.video import write_video

SAMPLE_RATE_HZ = 22_050  # of the ears


def record_episode(path: Path, game: GameCfg, policy: ActionPolicy, seed: int) -> None:
    """Play one episode with the policy's most likely actions and write it as a video.

    It shows the first agent of the first team, with the sound that the agent receives; without
    the sense of hearing the video is silent.

    Args:
        path: The MP4 file.
        game: The game.
        policy: Writes the actions of all teams.
        seed: Seed of the episode.
    """
    frames: list[NDArray[np.uint8]] = []
    sound: list[NDArray[Any]] = []
    with (
        closing(VecaEnv(game.with_waveform(), worlds=1, seed=seed)) as env,
        torch.no_grad(),
        set_exploration_type(ExplorationType.DETERMINISTIC),
    ):
        playing = with_memory(env, policy)
        state, done = playing.reset(), False
        while not done:
            played, state = playing.step_and_maybe_reset(policy(state))
            seen = _first_player(played["next"], env)
            frames.append(env.spectators[0].frame(seen))
            if "waveform" in seen:
                sound.append(seen["waveform"])
            done = bool(played["next", "done"].all())
    waveform = np.concatenate(sound, axis=1) if sound else None
    write_video(path, frames, waveform, game.clock.control_rate_hz, SAMPLE_RATE_HZ)


def _first_player(step: TensorDictBase, env: VecaEnv) -> dict[str, NDArray[Any]]:
    team = next(iter(env.group_map))
    return {name: array[0, 0].numpy() for name, array in step[team, "observation"].items()}

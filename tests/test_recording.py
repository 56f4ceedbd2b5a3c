"""The video of a real episode: images of the eyes, sound at the ears."""

from itertools import pairwise

import av
import numpy as np
import pytest
from composed import compose

from veca_marl.algos.evaluation.evaluate import random_policy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.video import record_episode


def record(path, *overrides):
    game = compose(["+task=KickTheBall", "task.max_seconds=1.0", *overrides]).game
    env = VecaEnv(game, 1, 0)
    policy = random_policy(env)
    env.close()
    record_episode(path, game, policy, seed=1)
    with av.open(str(path)) as container:
        pictures = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
    with av.open(str(path)) as container:
        if not container.streams.audio:
            return game, pictures, None
        return (
            game,
            pictures,
            np.concatenate([f.to_ndarray() for f in container.decode(audio=0)], axis=1),
        )


def test_a_team_with_ears_of_its_own_is_heard(tmp_path):
    words = ["+senses/audio@team.agents.senses.audio=mono", "senses/vision=blind"]
    assert record(tmp_path / "video.mp4", *words)[2] is not None


def test_the_world_is_closed_after_an_error(tmp_path, monkeypatch):
    closed = []
    monkeypatch.setattr(VecaEnv, "close", lambda self, **_: closed.append(self))

    def fail(state):
        raise ArithmeticError

    game = compose(["+task=KickTheBall", "senses/vision=blind"]).game
    with pytest.raises(ArithmeticError):
        record_episode(tmp_path / "video.mp4", game, fail, seed=1)
    assert len(closed) == 1


def difference_of_ears(sound):
    """Return it as a share of the sound's level, after the codec has settled."""
    settled = sound[:, 22_050 // 4 :]
    return (settled[0] - settled[1]).std() / settled.std()


def test_video_has_one_frame_per_step_and_the_sound_at_the_ears(tmp_path):
    game, pictures, sound = record(tmp_path / "video.mp4")
    assert len(pictures) == 25
    assert pictures[0].std() > 10, "the images are not uniform"
    assert sound.shape[1] / 22_050 == pytest.approx(1.0, abs=0.15)
    assert sound.std() > 0.01, "the ball is audible"
    assert difference_of_ears(sound) > 0.2, "the ears differ"
    assert not game.senses.audio.waveform, "the configuration of the run is unchanged"


@pytest.mark.slow
def test_mono_gives_equal_channels_and_deaf_none(tmp_path):
    _, _, mono = record(tmp_path / "mono.mp4", "senses/audio=mono")
    assert difference_of_ears(mono) < 0.05
    _, _, stereo = record(tmp_path / "stereo.mp4", "senses/audio=stereo")
    assert difference_of_ears(stereo) > 0.2
    _, pictures, silence = record(tmp_path / "deaf.mp4", "senses/audio=deaf")
    assert silence is None
    assert len(pictures) == 25


def test_a_blind_agent_is_recorded_without_panels_of_eyes(tmp_path):
    _, seeing, _ = record(tmp_path / "seeing.mp4")
    _, blind, _ = record(tmp_path / "blind.mp4", "senses/vision=blind")
    assert blind[0].shape == seeing[0].shape == (450, 800, 3)
    assert (blind[0] != seeing[0]).any()


def test_the_last_picture_is_of_the_episode_that_ends(tmp_path):
    """The room does not jump to the start of the next episode."""
    _, pictures, _ = record(tmp_path / "video.mp4", "senses/vision=blind")
    moved = [np.abs(b.astype(int) - a).mean() for a, b in pairwise(pictures)]
    assert moved[-1] < 3.0 * max(moved[:-1])

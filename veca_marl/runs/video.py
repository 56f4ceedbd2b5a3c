"""Videos of episodes, with the sound at the ears of an agent."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
import torch
from av.codec.codec import UnknownCodecError
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.algos.evaluation.evaluate import ActionPolicy
from veca_marl.algos.files import new_temporary
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.rendering import Film, FilmCfg, FilmQuality
from veca_marl.runs.episode_page import EpisodeRecorder, play, write_page

_PEAK = 0.8  # of full scale
# Codecs and their options; the first that is available is used. The default preset of x264 takes
# more processor time than the episode itself, this one a fifth of that.
_VIDEO_CODECS = {"libx264": {"preset": "veryfast", "crf": "21"}, "mpeg4": {}}


def write_video(
    path: Path,
    frames: Sequence[NDArray[np.uint8]],
    waveform: NDArray[np.float32] | None,
    fps: int,
    sample_rate_hz: int,
) -> None:
    """Write an MP4 file with H.264 (or MPEG-4) pictures and AAC stereo sound.

    The file is complete or does not exist. The sound is scaled by one factor to a fixed peak, so
    that levels over time and between the ears keep their ratios.

    Args:
        path: The file; missing folders are created.
        frames: Images ``(height, width, 3)`` uint8 of one shape, with even height and width.
        waveform: ``(2, samples)``, left and right ear; None for a video without sound.
        fps: Frames per second.
        sample_rate_hz: Samples per second.

    Raises:
        ValueError: If frames or waveform are not as described.
    """
    _check(frames, waveform)
    rate_hz = None if waveform is None else sample_rate_hz
    with VideoFile(path, frames[0].shape[:2], fps, rate_hz) as file:
        for picture in frames:
            file.add_picture(picture)
        if waveform is not None:
            file.add_sound(waveform)


class VideoFile:
    """An MP4 file that is written picture by picture, as a context manager.

    The file is complete, or does not exist if the block was left by an exception.

    Args:
        path: The file; missing folders are created.
        size: Height and width of the pictures, both even.
        fps: Frames per second.
        sample_rate_hz: Samples per second of the sound; None for a video without sound.
    """

    def __init__(
        self, path: Path, size: tuple[int, ...], fps: int, sample_rate_hz: int | None
    ) -> None:
        self._path, self._temporary = path, new_temporary(path)
        self._container = av.open(str(self._temporary), "w", format="mp4")
        self._pictures = _add_pictures(self._container, size, fps)
        self._sample_rate_hz = sample_rate_hz
        if sample_rate_hz is not None:
            self._sound = _add_sound(self._container, sample_rate_hz)

    def __enter__(self) -> VideoFile:
        """Return the file."""
        return self

    def add_picture(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture ``(height, width, 3)`` uint8."""
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        self._container.mux(self._pictures.encode(frame))

    def add_sound(self, waveform: NDArray[np.float32]) -> None:
        """Add the whole sound ``(2, samples)``, scaled to a fixed peak; call it at most once.

        Raises:
            ValueError: If the file was made without sound.
        """
        if self._sample_rate_hz is None:
            raise ValueError(f"{self._path} was begun without sound")
        for block in _audio_frames(waveform, self._sample_rate_hz):
            self._container.mux(self._sound.encode(block))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Complete the file; remove it after an exception."""
        try:
            if kind is None:
                self._container.mux(self._pictures.encode(None))
                if self._sample_rate_hz is not None:
                    self._container.mux(self._sound.encode(None))
            self._container.close()
            if kind is None:
                os.replace(self._temporary, self._path)
        finally:
            self._temporary.unlink(missing_ok=True)


def _check(frames: Sequence[NDArray[np.uint8]], waveform: NDArray[np.float32] | None) -> None:
    if not len(frames):
        raise ValueError("a video needs at least one frame")
    shape = frames[0].shape
    if len(shape) != 3 or shape[2] != 3 or shape[0] % 2 or shape[1] % 2:
        raise ValueError(f"frames must be (even height, even width, 3), got {shape}")
    odd = next((f for f in frames if f.shape != shape or f.dtype != np.uint8), None)
    if odd is not None:
        raise ValueError(f"frames must all be uint8{shape}, got {odd.dtype}{odd.shape}")
    if waveform is not None and (waveform.ndim != 2 or waveform.shape[0] != 2):
        raise ValueError(f"waveform must be (2, samples), got {waveform.shape}")
    if waveform is not None and not np.isfinite(waveform).all():
        raise ValueError("waveform must be finite")


def _add_pictures(
    container: av.container.OutputContainer, shape: tuple[int, ...], fps: int
) -> av.VideoStream:
    codec = _codec()
    stream = container.add_stream(codec, rate=fps, options=_VIDEO_CODECS[codec])
    assert isinstance(stream, av.VideoStream)
    stream.height, stream.width = shape[:2]
    stream.pix_fmt = "yuv420p"
    if codec != "libx264":  # which keeps the quality constant instead
        stream.bit_rate = 4_000_000
    return stream


def _codec() -> str:
    for name in _VIDEO_CODECS:
        try:
            av.Codec(name, "w")
        except UnknownCodecError:
            continue
        return name
    raise RuntimeError(f"none of the video codecs {list(_VIDEO_CODECS)} is installed")


def _add_sound(container: av.container.OutputContainer, sample_rate_hz: int) -> av.AudioStream:
    stream = container.add_stream("aac", rate=sample_rate_hz)
    assert isinstance(stream, av.AudioStream)
    stream.layout = "stereo"
    stream.bit_rate = 128_000
    return stream


def _audio_frames(
    waveform: NDArray[np.float32], sample_rate_hz: int, block: int = 1024
) -> Iterator[av.AudioFrame]:
    peak = float(np.abs(waveform).max(initial=0.0))
    scaled = waveform * (_PEAK / peak) if peak > 0.0 else waveform
    for start in range(0, waveform.shape[1], block):
        part = np.ascontiguousarray(scaled[:, start : start + block], dtype=np.float32)
        frame = av.AudioFrame.from_ndarray(part, format="fltp", layout="stereo")
        frame.sample_rate, frame.pts = sample_rate_hz, start
        frame.time_base = Fraction(1, sample_rate_hz)
        yield frame


def animated_gif(path: Path, fps: int = 10, scale: float = 0.5) -> bytes:
    """Return the pictures of a video as an animated GIF, without its sound.

    Args:
        path: The video.
        fps: About how many of its pictures per second are kept.
        scale: Their size, as a share of that in the video.
    """
    target = BytesIO()
    with av.open(str(path)) as source, av.open(target, "w", format="gif") as gif:
        pictures = source.streams.video[0]
        keep = max(round(float(pictures.average_rate or fps) / fps), 1)
        stream = gif.add_stream("gif", rate=fps)
        assert isinstance(stream, av.VideoStream)
        stream.height, stream.width = (round(scale * n) for n in (pictures.height, pictures.width))
        stream.pix_fmt = "rgb8"
        for number, picture in enumerate(source.decode(pictures)):
            if number % keep == 0:
                small = picture.reformat(stream.width, stream.height, "rgb8")
                small.pts, small.time_base = number // keep, Fraction(1, fps)
                gif.mux(stream.encode(small))
        gif.mux(stream.encode(None))
    return target.getvalue()


SAMPLE_RATE_HZ = 22_050  # of the ears
FILM = FilmCfg(width=800, height=450, quality=FilmQuality.good)
"""The films of training runs."""


LONGEST_PAGE_S = 60.0  # of the page that a run leaves: about 3 MB per agent that sees and hears


def record_episode(
    path: Path, game: GameCfg, policy: ActionPolicy, seed: int, page: Path | None = None
) -> None:
    """Play one episode with the policy's most likely actions and write it as a video.

    It shows the first agent of the first team, with the sound that the agent receives; without
    the sense of hearing the video is silent.

    Args:
        path: The MP4 file.
        game: The game.
        policy: Writes the actions of all teams.
        seed: Seed of the episode.
        page: An HTML file of the same episode with all agents, its first minute if it is longer;
            None writes none.
    """
    frames: list[NDArray[np.uint8]] = []
    sound: list[NDArray[Any]] = []
    with (
        closing(VecaEnv(game.with_waveform(), worlds=1, seed=seed)) as env,
        torch.no_grad(),
        set_exploration_type(ExplorationType.DETERMINISTIC),
    ):
        episode = play(env, policy)
        next(episode)
        film, recorder = Film(env.games[0], FILM), EpisodeRecorder(env, LONGEST_PAGE_S)
        if page is not None:
            recorder.begin()
        for played in episode:
            seen = _first_player(played["next"], env)
            frames.append(film.picture(seen))
            if "waveform" in seen:
                sound.append(seen["waveform"])
            if page is not None:
                recorder.add(played)
    waveform = np.concatenate(sound, axis=1) if sound else None
    write_video(path, frames, waveform, game.clock.control_rate_hz, SAMPLE_RATE_HZ)
    if page is not None:
        details = {"policy": "trained", "seed": seed}
        write_page(page, recorder.episode(game.task.name, details, SAMPLE_RATE_HZ))


def _first_player(step: TensorDictBase, env: VecaEnv) -> dict[str, NDArray[Any]]:
    team = next(iter(env.group_map))
    return {name: array[0, 0].numpy() for name, array in step[team, "observation"].items()}

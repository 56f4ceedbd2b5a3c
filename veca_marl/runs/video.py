"""Writes frames and binaural sound into an MP4 file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.codec.codec import UnknownCodecError
from numpy.typing import NDArray

_PEAK = 0.8  # of full scale
# Codecs and their options; the first that is available is used. The default preset of x264 takes
# more processor time than the episode itself, this one a fifth of that.
_VIDEO_CODECS = {"libx264": {"preset": "ultrafast"}, "mpeg4": {}}


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
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with av.open(str(temporary), "w", format="mp4") as container:
            pictures = _add_pictures(container, frames[0].shape, fps)
            sound = None if waveform is None else _add_sound(container, sample_rate_hz)
            for frame in _video_frames(frames):
                container.mux(pictures.encode(frame))
            container.mux(pictures.encode(None))
            if sound is not None and waveform is not None:
                for block in _audio_frames(waveform, sample_rate_hz):
                    container.mux(sound.encode(block))
                container.mux(sound.encode(None))
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


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
    stream.bit_rate = 2_000_000
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


def _video_frames(frames: Sequence[NDArray[np.uint8]]) -> Iterator[av.VideoFrame]:
    for picture in frames:
        yield av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")


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

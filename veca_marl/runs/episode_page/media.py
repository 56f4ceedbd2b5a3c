"""Pictures and sound as files that browsers decode: WebP, and Opus in Ogg or else WAV."""

from __future__ import annotations

import wave
from fractions import Fraction
from io import BytesIO
from typing import Any

import av
import cv2
import numpy as np
from av.codec.codec import UnknownCodecError
from numpy.typing import NDArray

PEAK = 0.8  # of full scale
OPUS_RATE_HZ = 48_000
_BIT_RATE = 128_000
_LOSSLESS = 101  # of OpenCV
_QUALITY = 90
_DEAR_BYTES = 2500  # per step; above it a lossless sheet gives way to one of high quality


def picture_sheet(pictures: list[NDArray[np.uint8]]) -> bytes:
    """Return pictures of two eyes as one WebP file, a row for each step, the left eye left.

    They are stored exactly, unless that takes more than 2.5 kB per step.

    Args:
        pictures: ``(2, 3, H, W)`` uint8 for each step, red first.
    """
    steps, _, _, height, width = (stacked := np.stack(pictures)).shape
    rows = stacked.transpose(0, 3, 1, 4, 2).reshape(steps * height, 2 * width, 3)
    image = np.ascontiguousarray(rows[..., ::-1])
    exact = _webp(image, _LOSSLESS)
    return exact if len(exact) <= _DEAR_BYTES * steps else _webp(image, _QUALITY)


def _webp(image: NDArray[np.uint8], quality: int) -> bytes:
    done, content = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise RuntimeError("OpenCV cannot write WebP")
    return content.tobytes()


def read_sheet(content: bytes, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the pictures ``(steps, 2, 3, H, W)`` of a sheet.

    Args:
        content: The file.
        size: Height and width of a picture.
    """
    height, width = size
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    if image is None or image.shape[0] % height or image.shape[1] != 2 * width:
        raise ValueError("not a sheet of pictures")
    rows = image[..., ::-1].reshape(-1, height, 2, width, 3)
    pictures: NDArray[Any] = rows.transpose(0, 2, 4, 1, 3)
    return pictures.astype(np.uint8)


def sound_file(waveform: NDArray[np.float32], rate_hz: int) -> tuple[bytes, str]:
    """Return a stereo sound as a file, and its type; its peak is 0.8 of full scale.

    Args:
        waveform: ``(2, samples)``.
        rate_hz: Samples per second.
    """
    peak = float(np.abs(waveform).max(initial=0.0))
    scaled = (waveform * (PEAK / peak) if peak > 0.0 else waveform).astype(np.float32)
    try:
        av.Codec("libopus", "w")
    except UnknownCodecError:
        return _wav(scaled, rate_hz), "audio/wav"
    return _opus(scaled, rate_hz), "audio/ogg"


def _wav(waveform: NDArray[np.float32], rate_hz: int) -> bytes:
    target = BytesIO()
    with wave.open(target, "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(np.rint(waveform.T * 32767.0).astype("<i2").tobytes())
    return target.getvalue()


def _opus(waveform: NDArray[np.float32], rate_hz: int) -> bytes:
    target = BytesIO()
    with av.open(target, "w", format="ogg") as file:
        stream = file.add_stream("libopus", rate=OPUS_RATE_HZ)
        assert isinstance(stream, av.AudioStream)
        stream.layout, stream.bit_rate = "stereo", _BIT_RATE
        resampler = av.AudioResampler("flt", "stereo", OPUS_RATE_HZ)
        interleaved = np.ascontiguousarray(waveform.T).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(interleaved, format="flt", layout="stereo")
        frame.sample_rate, frame.pts = rate_hz, 0
        frame.time_base = Fraction(1, rate_hz)
        for block in [*resampler.resample(frame), *resampler.resample(None)]:
            file.mux(stream.encode(block))
        file.mux(stream.encode(None))
    return target.getvalue()

"""Hearing: what the two ears of a body receive, as magnitude spectra and waveforms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Pose
from veca_marl.sim.hearing.hrtf import kemar_table, sofa_table
from veca_marl.sim.hearing.receivers import HeadRelated, OneEar, TwoEars
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.sound.receiver import Receiver
from veca_marl.sim.spec import ArraySpec

WINDOW_SAMPLES = 1024
N_BINS = 250
MAGNITUDE_FLOOR = 1e-8
SILENCE = -8.0


class AudioQuality(Enum):
    """How sound becomes two ear signals (the three arms of the paper's figure 5).

    `hrtf` is a human head, `stereo` two bare ears, `mono` the same sound in both ears.
    """

    hrtf = "hrtf"
    stereo = "stereo"
    mono = "mono"


class Window(Enum):
    """What the samples are weighted with before the Fourier transform."""

    rectangular = "rectangular"
    hann = "hann"


@dataclass
class AudioCfg:
    """Hearing as data.

    Attributes:
        present: Whether the body hears at all.
        quality: See `AudioQuality`. It changes what is heard, never its shape.
        waveform: Whether the samples themselves are observed too.
        sofa_path: A measured head (SOFA file) in place of KEMAR. Needs the extra ``[sofa]``.
        sofa_sample_rate_hz: The sampling rate to believe instead of the SOFA file's own.
        window: See `Window`; the paper's is rectangular.
        noise_floor_db: Level of the ear's own noise relative to an rms pressure of 1 (about -80),
            or None. It enters as its expected power, so nothing becomes random.
    """

    present: bool = True
    quality: AudioQuality = AudioQuality.hrtf
    waveform: bool = False
    sofa_path: str | None = None
    sofa_sample_rate_hz: float | None = None
    window: Window = Window.rectangular
    noise_floor_db: float | None = None

    def __post_init__(self) -> None:
        if self.sofa_sample_rate_hz is not None and self.sofa_path is None:
            raise ValueError(
                f"sofa_sample_rate_hz is {self.sofa_sample_rate_hz} but there is no sofa_path"
            )
        if self.noise_floor_db is not None and not np.isfinite(self.noise_floor_db):
            raise ValueError(f"noise_floor_db must be finite or None, got {self.noise_floor_db}")


class AudioSense(Sense):
    """Two ears on a body's head.

    Observations:
        audio: ``(2, 250)`` float32, left ear first: log10 of the magnitude of the first 250 bins
            of the Fourier transform of the last 1024 samples (the paper's own code). At 22 050 Hz
            that is 0 to 5.4 kHz in steps of 21.5 Hz. Exact silence is -8; a full-scale tone 2.7.
        waveform: ``(2, step_samples)`` float32 sound pressure of this step, on request.
    """

    cfg_type = AudioCfg

    def __init__(self, cfg: AudioCfg, body: Body, world: World) -> None:
        super().__init__(world)
        field = world.sound
        self._body = body
        head = body.mount("head")
        ears = np.stack([body.mount(name).position for name in ("ear_left", "ear_right")])
        in_head = (ears - head.position) @ head.rotation
        self._centre = in_head.mean(axis=0)
        left, right = in_head - self._centre
        self._listener = field.add_listener(
            _spatialisation(cfg, left, right, field.sample_rate_hz),
            memory_steps=math.ceil(WINDOW_SAMPLES / field.step_samples),
        )
        self._window = _window(cfg.window)
        self._noise_power = _noise_power(cfg.noise_floor_db, self._window)
        self._recent = np.zeros((2, max(WINDOW_SAMPLES, field.step_samples)), np.float32)
        self._step_samples = field.step_samples
        self.specs = {"audio": ArraySpec((2, N_BINS), np.float32, low=SILENCE)}
        if cfg.waveform:
            self.specs["waveform"] = ArraySpec((2, field.step_samples), np.float32)

    def reset(self) -> None:
        """See `Sense`."""
        super().reset()
        self._recent[:] = 0.0
        self._listener.reset()

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        head = self._body.mount("head")
        centre = Pose(head.position + head.rotation @ self._centre, head.rotation)
        if self._listener.missed_steps:
            self._rejoin(centre)
        heard = self._listener.render(centre)
        self._append(heard)
        observation = {"audio": self._observe()}
        if "waveform" in self.specs:
            observation["waveform"] = heard
        return observation

    def _rejoin(self, head: Pose) -> None:
        """Fill the window with the steps that were not read, as far as they reach into it."""
        in_window = math.ceil(WINDOW_SAMPLES / self._step_samples)
        self._append(self._listener.rejoin(head, min(self._listener.missed_steps, in_window)))

    def _append(self, heard: NDArray[np.float32]) -> None:
        """Move the window on by what was heard, the newest sample last."""
        n, size = heard.shape[1], self._recent.shape[1]
        if n < size:
            self._recent[:, :-n] = self._recent[:, n:]
        self._recent[:, -n:] = heard[:, -size:]

    def _observe(self) -> NDArray[np.float32]:
        return log_spectrum(self._recent[:, -WINDOW_SAMPLES:] * self._window, self._noise_power)


def log_spectrum(samples: NDArray[np.float32], noise_power: float = 0.0) -> NDArray[np.float32]:
    """Return what an ear tells the brain: ``log10(|rfft| + 1e-8)`` of the first 250 bins.

    Args:
        samples: ``(..., 1024)`` windowed sound pressure.
        noise_power: Expected squared magnitude of the ear's own noise.

    Returns:
        ``(..., 250)`` float32, from -8 on.
    """
    magnitude = np.abs(scipy.fft.rfft(samples)[..., :N_BINS])
    if noise_power > 0.0:
        magnitude = np.sqrt(magnitude**2 + np.float32(noise_power))
    spectrum = np.log10(magnitude + np.float32(MAGNITUDE_FLOOR))
    # the logarithm of a float32 may round to just below what the spec promises
    observation: NDArray[np.float32] = np.maximum(spectrum, np.float32(SILENCE))
    return observation


def _spatialisation(
    cfg: AudioCfg, left: NDArray[np.float64], right: NDArray[np.float64], sample_rate_hz: int
) -> Receiver:
    match cfg.quality:
        case AudioQuality.mono:
            return OneEar()
        case AudioQuality.stereo:
            return TwoEars(left, right)
        case AudioQuality.hrtf if cfg.sofa_path is None:
            return HeadRelated(kemar_table(sample_rate_hz))
        case AudioQuality.hrtf:
            return HeadRelated(sofa_table(cfg.sofa_path, sample_rate_hz, cfg.sofa_sample_rate_hz))


def _window(window: Window) -> NDArray[np.float32]:
    if window is Window.hann:
        return np.hanning(WINDOW_SAMPLES + 1)[:-1].astype(np.float32)
    return np.ones(WINDOW_SAMPLES, np.float32)


def _noise_power(noise_floor_db: float | None, window: NDArray[np.float32]) -> float:
    if noise_floor_db is None:
        return 0.0
    return float(10.0 ** (noise_floor_db / 10.0) * (window**2).sum())

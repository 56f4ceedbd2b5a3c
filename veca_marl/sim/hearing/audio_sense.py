"""The sense of hearing: what the two ears of a body receive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing.encodings import (
    MOST_BINS,
    N_BINS,
    WINDOW_SAMPLES,
    Encoding,
    Noise,
    Window,
    make_encoder,
)
from veca_marl.sim.hearing.head_response import HeadResponse, check_scale
from veca_marl.sim.hearing.hrtf import kemar_response, kemar_table, sofa_response, sofa_table
from veca_marl.sim.hearing.receivers import HrtfReceiver, MonoReceiver, StereoReceiver
from veca_marl.sim.hearing.sofa_file import check_can_read_sofa
from veca_marl.sim.physics import World
from veca_marl.sim.sense import ArraySpec, Sense
from veca_marl.sim.sound import NEAR_FIELD_M, Receiver


class AudioQuality(Enum):
    """The receiver that turns sound into two ear signals (the three arms of the paper's figure 5).

    All qualities have the same size of head.

    Attributes:
        hrtf: A head-related transfer function: level, arrival time and spectrum per direction.
        stereo: Two omnidirectional receivers at the ears of the same head: no head shadow, no
            pinnae. Their distance is the diameter of the sphere that fits its arrival times.
        mono: One omnidirectional receiver at the centre of the head, repeated for both ears.
    """

    hrtf = "hrtf"
    stereo = "stereo"
    mono = "mono"


_MOST_DB = 200.0  # the squared magnitudes are numbers of single precision


@dataclass
class AudioCfg:
    """Settings of the sense of hearing.

    Attributes:
        present: Whether the observation contains the sense.
        quality: See `AudioQuality`. It changes the content of the observation, never its shape.
        encoding: What the observation contains, see `Encoding`.
        bins: Number of bins of the spectra, 21.5 Hz each: 250 end at 5.4 kHz, 513 at 11 kHz. The
            frontal notches of KEMAR's pinnae, which depend on the elevation, are between 6.7 and
            10.5 kHz.
        waveform: Whether the samples of each step are observed too, as ``waveform``.
        sofa_path: SOFA file of a measured head in place of KEMAR. Needs the extra ``[sofa]``.
        sofa_sample_rate_hz: Sampling rate to use instead of the one that the SOFA file states.
        head_scale: Size of the head relative to the measured one, from 0.5 to 1.5: spectral
            features are at ``1 / head_scale`` times their frequency, interaural times and the
            distance of the ears `head_scale` times as long (Middlebrooks 1999). KEMAR is an adult
            (diameter 0.175 m); 0.733 gives the 0.128 m between the ears of the body of 0.78 m. On a
            body of another size it is in proportion to the head.
        window: See `Window`.
        noise_floor_db: Level of the receiver's own noise relative to an rms pressure of 1, from
            -200 to 200, such as -80, or None. Its expected power is added, so that nothing becomes
            random.
        infant_age_months: Age of the ears: a tone at the threshold of hearing of that age is as
            loud as the receiver's own noise, see `veca_marl.sim.hearing.infant_hearing`; None for
            no threshold. Like that noise it is in spectra and not in samples.
    """

    present: bool = True
    quality: AudioQuality = AudioQuality.hrtf
    encoding: Encoding = Encoding.magnitude
    bins: int = N_BINS
    waveform: bool = False
    sofa_path: str | None = None
    sofa_sample_rate_hz: float | None = None
    head_scale: float = 1.0
    window: Window = Window.rectangular
    noise_floor_db: float | None = None
    infant_age_months: float | None = None

    def __post_init__(self) -> None:
        _check_choice("quality", self.quality, AudioQuality)
        _check_choice("window", self.window, Window)
        _check_choice("encoding", self.encoding, Encoding)
        if not 1 <= self.bins <= MOST_BINS:
            raise ValueError(f"senses.audio.bins={self.bins} must be from 1 to {MOST_BINS}")
        check_scale(self.head_scale)
        if self.sofa_sample_rate_hz is not None and self.sofa_path is None:
            raise ValueError(
                f"sofa_sample_rate_hz is {self.sofa_sample_rate_hz} but there is no sofa_path"
            )
        if self.sofa_path is not None:
            check_can_read_sofa(self.sofa_path)
        if self.noise_floor_db is not None and not abs(self.noise_floor_db) <= _MOST_DB:
            raise ValueError(
                f"senses.audio.noise_floor_db={self.noise_floor_db} must be from {-_MOST_DB:g} to "
                f"{_MOST_DB:g}, or null for no noise"
            )
        age_months = self.infant_age_months
        if age_months is not None and not 0.0 < age_months < math.inf:
            raise ValueError(
                f"senses.audio.infant_age_months={age_months} must be finite and positive, or null"
            )


def _check_choice(name: str, value: object, kinds: type[Enum]) -> None:
    """Raise `ValueError` with the choices if a value is not one of them."""
    if not isinstance(value, kinds):
        choices = [kind.name for kind in kinds]
        raise ValueError(f"senses.audio.{name}={value!r}; choices: {choices}")


class AudioSense(Sense):
    """Two ears on the head of a body.

    After steps that were not read, the sound of those steps is computed as if the head, the
    sources and the walls had been where they are at the next read. That is exact where nothing
    moved; what moved lacks its Doppler shift in those steps (see `Listener.rejoin`).

    Observations:
        audio: ``(2, 250)`` float32 by default, left ear first: log10 of the magnitude of the first
            250 bins of the Fourier transform of the last 1024 samples (the formula of the paper's
            code). At 22 050 Hz these are 0 to 5.4 kHz in steps of 21.5 Hz. Exact silence is -8; a
            full-scale sine is 2.7. `AudioCfg.encoding` and `AudioCfg.bins` change its form.
        waveform: ``(2, step_samples)`` float32 sound pressure of this step, on request.
    """

    cfg_type = AudioCfg

    def __init__(self, cfg: AudioCfg, body: Body, world: World) -> None:
        super().__init__(world)
        field = world.sound
        self._body = body
        self._centre, nearest_m = _centre_of_ears(body), _mouth_to_ears_m(body)
        self._steps_in_window = math.ceil(WINDOW_SAMPLES / field.step_samples)
        self._listener = field.add_listener(
            make_receiver(_on_head(cfg, body), field.sample_rate_hz, nearest_m),
            self._steps_in_window,
            body.deaf_to,
        )
        self._teleports = body.teleports
        self._encoder = make_encoder(
            cfg.encoding, cfg.window, cfg.noise_floor_db, cfg.bins, cfg.infant_age_months
        )
        self._recent = np.zeros((2, max(WINDOW_SAMPLES, field.step_samples)), np.float32)
        self.specs = {"audio": self._encoder.spec}
        if cfg.waveform:
            self.specs["waveform"] = ArraySpec((2, field.step_samples), np.float32)

    @property
    def noise_power(self) -> Noise:
        """Squared magnitude of the receivers' own noise in each bin; 0 without noise."""
        return self._encoder.noise_power

    def log_magnitudes(self, audio: NDArray[Any]) -> NDArray[Any]:
        """Return the log10 of the magnitudes in an observation ``audio``, ``(2, bins)``.

        Args:
            audio: In the encoding of this sense.
        """
        return self._encoder.log_magnitudes(audio)

    def reset(self) -> None:
        """See `Sense`."""
        super().reset()
        self._teleports = self._body.teleports
        self._recent[:] = 0.0
        self._listener.reset()

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        head = self._body.mount("head")
        centre = Pose(head.position + head.rotation @ self._centre, head.rotation)
        if self._body.teleports != self._teleports:
            self._listener.teleport()
        self._teleports = self._body.teleports
        missed = self._listener.missed_steps
        if missed:
            self._append(self._listener.rejoin(centre, min(missed, self._steps_in_window)))
        waveform = self._listener.render(centre)
        self._append(waveform)
        observation = {"audio": self._encoder.encode(self._recent[:, -WINDOW_SAMPLES:])}
        if "waveform" in self.specs:
            observation["waveform"] = waveform
        return observation

    def _append(self, waveform: NDArray[np.float32]) -> None:
        """Shift the recent samples by the length of a waveform ``(2, n)`` and append it."""
        n, size = waveform.shape[1], self._recent.shape[1]
        if n < size:
            self._recent[:, :-n] = self._recent[:, n:]
        self._recent[:, -n:] = waveform[:, -size:]


def _on_head(cfg: AudioCfg, body: Body) -> AudioCfg:
    """Return the settings for the head of a body.

    Raises:
        ValueError: If no receiver is so small or so large.
    """
    size = body.growth.head_size
    try:
        return replace(cfg, head_scale=cfg.head_scale * size)
    except ValueError as error:
        raise ValueError(
            f"senses.audio.head_scale={cfg.head_scale} on a head of {size:.3g} times the size of "
            f"that of the body of 0.78 m: {error}"
        ) from None


def _centre_of_ears(body: Body) -> Floats:
    """Return the point between the ears in the head frame, ``(3,)`` metres."""
    head = body.mount("head")
    ears = np.stack([body.mount(name).position for name in ("ear_left", "ear_right")])
    centre: Floats = ((ears - head.position) @ head.rotation).mean(axis=0)
    return centre


def _mouth_to_ears_m(body: Body) -> float:
    """Return the distance of the mouth from the nearer ear."""
    mouth = body.mount("mouth").position
    ears = [body.mount(name).position for name in ("ear_left", "ear_right")]
    return min(float(np.linalg.norm(ear - mouth)) for ear in ears)


def make_receiver(cfg: AudioCfg, sample_rate_hz: int, nearest_m: float = NEAR_FIELD_M) -> Receiver:
    """Construct the receiver of a configuration.

    Args:
        cfg: Quality and head.
        sample_rate_hz: Sampling rate of the sound field.
        nearest_m: Distance below which the gain of receivers without a head is constant; with a
            head it is `NEAREST_RADII` times its radius.

    Raises:
        SofaError: If the SOFA file cannot be used.
        ValueError: If KEMAR is not available at this sampling rate.
    """
    match cfg.quality:
        case AudioQuality.mono:
            return MonoReceiver(nearest_m)
        case AudioQuality.stereo:
            radius_m = cfg.head_scale * _measured_response(cfg, sample_rate_hz).head_radius_m
            return StereoReceiver((0.0, radius_m, 0.0), (0.0, -radius_m, 0.0), nearest_m)
        case AudioQuality.hrtf if cfg.sofa_path is None:
            return HrtfReceiver(kemar_table(sample_rate_hz, cfg.head_scale))
        case AudioQuality.hrtf:
            rates_hz = sample_rate_hz, cfg.sofa_sample_rate_hz
            return HrtfReceiver(sofa_table(cfg.sofa_path, *rates_hz, cfg.head_scale))


def _measured_response(cfg: AudioCfg, sample_rate_hz: int) -> HeadResponse:
    if cfg.sofa_path is None:
        return kemar_response(sample_rate_hz)
    return sofa_response(cfg.sofa_path, sample_rate_hz, cfg.sofa_sample_rate_hz)

"""Recordings of sound at the ears of a head that is anywhere in a room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from veca_marl.datasets.fields import Field, Role
from veca_marl.sim.body.sense_organs import MOUNTS_M
from veca_marl.sim.geometry import Floats, Pose, rotation_about_vertical
from veca_marl.sim.hearing import AudioCfg
from veca_marl.sim.hearing.audio_sense import make_receiver
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.physics.playground import make_house
from veca_marl.sim.sound import SAMPLE_RATE_HZ, Clip, Noise, Sound, SoundField, buzz

STEP_SAMPLES = 882
"""Samples of a step of the sound field, 40 ms as in the steps of agents."""

_STEPS = 5  # 0.2 s
RECORDING_SAMPLES = _STEPS * STEP_SAMPLES
_BEFORE_STEPS = 2  # sound and echoes are on their way already when the recording begins
_LEVEL = 0.1  # of the waveforms that are kept, rms pressure at 1 m
_HIGHEST_HZ = 400

_EARS = np.array(MOUNTS_M["ear_left"]), np.array(MOUNTS_M["ear_right"])
EAR_CENTRE_M: Floats = (_EARS[0] + _EARS[1]) / 2.0
"""The point between the ears in the frame of the head."""

_MOUTH_TO_EAR_M = float(np.linalg.norm(_EARS[0] - np.array(MOUNTS_M["mouth"])))


class SourceKind(IntEnum):
    """Kinds of sounds that are recorded."""

    buzz = 0
    noise = 1


@dataclass(frozen=True)
class SoundDraw:
    """A sound that was drawn.

    Attributes:
        kind: Its kind.
        sound: What is emitted.
    """

    kind: SourceKind
    sound: Sound


def draw_sound(rng: np.random.Generator, level_db: tuple[float, float]) -> SoundDraw:
    """Return a buzz of 100 to 400 Hz or white noise.

    Args:
        rng: Source of kind, pitch, phase and level.
        level_db: Least and greatest level, relative to an rms pressure of 1 at 1 m.
    """
    kind = SourceKind(int(rng.integers(len(SourceKind))))
    level = 10.0 ** (float(rng.uniform(*level_db)) / 20.0)
    pitch_hz = int(rng.integers(100, _HIGHEST_HZ + 1))
    if kind is SourceKind.noise:
        return SoundDraw(kind, Noise(level, SAMPLE_RATE_HZ))
    # waveforms are kept by pitch and level: one level, so that not every sample keeps one
    waveform = buzz(pitch_hz, _LEVEL, SAMPLE_RATE_HZ) * np.float32(level / _LEVEL)
    return SoundDraw(kind, Clip(waveform, loop=True))


class Recorder:
    """A head with the ears of the settings of hearing, in the rooms of a playground.

    Args:
        cfg: The settings of the sense.
        playground: The playground; its toys and furniture do not matter to the sound.
    """

    def __init__(self, cfg: AudioCfg, playground: PlaygroundCfg) -> None:
        self._field = SoundField(make_house(playground), step_samples=STEP_SAMPLES)
        receiver = make_receiver(cfg, self._field.sample_rate_hz, _MOUTH_TO_EAR_M)
        self._source = self._field.add_source("source", Clip(np.zeros(1)))
        self._listener = self._field.add_listener(receiver)

    def record(
        self, rng: np.random.Generator, sound: Sound, source: Floats, ears: Pose
    ) -> NDArray[np.float32]:
        """Return what the ears hear of a sound that goes on, ``(2, 4410)``, left ear first.

        Args:
            rng: Source of the sound's phase or noise.
            sound: The sound.
            source: ``(3,)`` metres.
            ears: Point between the ears, and rotation of the head.
        """
        self._source.sound = sound
        self._source.teleport(source)
        self._field.reset(rng)
        heard = []
        for _ in range(_BEFORE_STEPS + _STEPS):
            self._field.advance()
            heard.append(self._listener.render(ears))
        return np.concatenate(heard[_BEFORE_STEPS:], axis=1)


def waveform_field() -> Field:
    """Return the field of a recording."""
    return Field(
        (2, RECORDING_SAMPLES), "float32", Role.input, -1e4, 1e4,
        "full scale of a WAV file",
        f"sound pressure at the left and the right ear, {SAMPLE_RATE_HZ} Hz",
    )  # fmt: skip


def head_rotation(rng: np.random.Generator, tilt_deg: float) -> Floats:
    """Return the rotation of a head that faces anywhere, tilted by up to an angle each way.

    Args:
        rng: Source of the angles.
        tilt_deg: Greatest pitch and roll.
    """
    yaw = float(rng.uniform(-math.pi, math.pi))
    pitch, roll = np.radians(rng.uniform(-tilt_deg, tilt_deg, 2))
    tilt = Rotation.from_euler("YX", [pitch, roll]).as_matrix()
    return np.asarray(rotation_about_vertical(yaw) @ tilt, np.float64)


def direction_in_head(rotation: Floats, vector: Sequence[float] | Floats) -> Floats:
    """Return the unit vector of a vector of the world, ``(3,)``, in the frame of the head."""
    local = rotation.T @ np.asarray(vector, np.float64)
    return np.asarray(local / np.linalg.norm(local), np.float64)

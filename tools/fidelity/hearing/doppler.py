"""Doppler effect of the direct sound and of reflections.

A source moves towards a listener or away from it, and a wall reflects its sound from behind. The
image source moves in the opposite direction: one of the sounds is heard higher, the other lower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.signal

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_most
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing import HrtfReceiver, MonoReceiver, StereoReceiver, kemar_table
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS, Clip, Receiver, Room, SoundField

SAMPLE_RATE_HZ = 22_050
STEP_SAMPLES = 882
SPEEDS_MPS = (-3.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
"""Speeds towards the listener."""
PITCHES_HZ = (500.0, 1000.0, 2000.0)

_N_STEPS = 16
_ROOM_M = (8.0, 6.0, 3.0)
_ONLY_BACK_WALL = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
_HEAD = Pose(np.array([1.0, 3.0, 1.5]), np.eye(3))
_NEAREST_M = 0.6


@dataclass(frozen=True)
class HeardTone:
    """What is heard of a tone.

    Attributes:
        frequency_hz: Its mean frequency.
        ripple_db: Ratio of the greatest to the least amplitude, after correction for 1/distance.
    """

    frequency_hz: float
    ripple_db: float


def approaching_source(
    speed_mps: float, pitch_hz: float, receiver: Receiver
) -> tuple[HeardTone, HeardTone]:
    """Return the direct sound and the reflection of a source that approaches from straight ahead.

    Args:
        speed_mps: Its speed; negative for a source that recedes.
        pitch_hz: The tone that it emits.
        receiver: The ears; the left one is measured.
    """
    seconds = _N_STEPS * STEP_SAMPLES / SAMPLE_RATE_HZ
    sample = np.arange(_N_STEPS * STEP_SAMPLES)
    sound: Floats = np.sin(2.0 * np.pi * pitch_hz / SAMPLE_RATE_HZ * sample)
    start_m = _NEAREST_M + max(speed_mps * seconds, 0.0)
    direct = _render(sound, start_m, speed_mps, receiver, image_order=0)
    with_reflection = _render(sound, start_m, speed_mps, receiver, image_order=1)
    time_s = np.arange(1, sound.size + 1) / SAMPLE_RATE_HZ
    distance_m = start_m - speed_mps * time_s
    behind_m = 2.0 * (_ROOM_M[0] - _HEAD.position[0]) - distance_m
    # propagation is linear: the reflection is what the wall adds
    return _measure(direct, distance_m), _measure(with_reflection - direct, behind_m)


def _render(
    sound: Floats, start_m: float, speed_mps: float, receiver: Receiver, image_order: int
) -> Floats:
    room = Room(np.zeros(3), _ROOM_M, _ONLY_BACK_WALL)
    field = SoundField(room, STEP_SAMPLES, SAMPLE_RATE_HZ, image_order)
    source = field.add_source("tone", Clip(sound))
    listener = field.add_listener(receiver)
    field.reset(np.random.default_rng(0))
    heard = []
    for step in range(1, _N_STEPS + 1):
        away_m = start_m - speed_mps * step * STEP_SAMPLES / SAMPLE_RATE_HZ
        source.position = _HEAD.position + np.array([away_m, 0.0, 0.0])
        field.advance()
        heard.append(listener.render(_HEAD)[0])
    return np.concatenate(heard).astype(np.float64)


def _measure(heard: Floats, distance_m: Floats) -> HeardTone:
    """Measure a tone by its analytic signal, without the first and the last steps."""
    inside = slice(6 * STEP_SAMPLES, -2 * STEP_SAMPLES)
    tone = scipy.signal.hilbert(heard)[inside]
    phase = np.unwrap(np.angle(tone))
    slope = np.polyfit(np.arange(phase.size) / SAMPLE_RATE_HZ, phase, 1)[0]
    amplitude = np.abs(tone) * distance_m[inside]
    return HeardTone(
        float(slope / (2.0 * np.pi)), float(20.0 * np.log10(amplitude.max() / amplitude.min()))
    )


def receivers() -> dict[str, Receiver]:
    """Return a receiver of each quality of hearing."""
    head = kemar_table()
    ear_m = head.head_radius_m
    return {
        "hrtf": HrtfReceiver(head),
        "stereo": StereoReceiver((0.0, ear_m, 0.0), (0.0, -ear_m, 0.0)),
        "mono": MonoReceiver(),
    }


def theory_hz(speed_mps: float, pitch_hz: float) -> float:
    """Return the frequency at which a source is heard that approaches at a speed."""
    return pitch_hz / (1.0 - speed_mps / SPEED_OF_SOUND_MPS)


def section() -> Section:
    """Measure the Doppler effect for the page."""
    text = (
        "A source straight ahead approaches at v or recedes (v < 0), a wall reflects its sound "
        "from behind; with HRTF, with two omnidirectional receivers and with one. Frequency from "
        "the phase of the analytic signal at the left ear, against `f / (1 - v / c)` for the "
        "direct sound and `f / (1 + v / c)` for the reflection. "
        "The simulator uses the distance at the time of arrival; the rest is of order `(v / c)^2`."
    )
    laws: list[Law] = []
    plots: list[Plot] = []
    for name, receiver in receivers().items():
        tones = {
            (speed, pitch): approaching_source(speed, pitch, receiver)
            for pitch in PITCHES_HZ
            for speed in SPEEDS_MPS
        }
        laws += _laws(name, tones)
        highest = [tones[speed, PITCHES_HZ[-1]] for speed in SPEEDS_MPS]
        plots.append(_plot(name, highest))
    return Section("Doppler effect", text, laws, plots)


def _laws(
    receiver: str, tones: dict[tuple[float, float], tuple[HeardTone, HeardTone]]
) -> list[Law]:
    laws = []
    for path, (name, sign) in enumerate((("direct sound", 1.0), ("reflection", -1.0))):
        errors = [
            abs(heard[path].frequency_hz - theory_hz(sign * speed, pitch))
            for (speed, pitch), heard in tones.items()
        ]
        ripples = [heard[path].ripple_db for heard in tones.values()]
        to = f"{receiver}, up to {SPEEDS_MPS[-1]:g} m/s and {PITCHES_HZ[-1]:g} Hz"
        laws.append(at_most(f"frequency of the {name}, error, {to}", "Hz", 1.0, max(errors)))
        laws.append(at_most(f"ripple of the {name}, {to}", "dB", 1.0, max(ripples)))
    return laws


def _plot(receiver: str, tones: Sequence[tuple[HeardTone, HeardTone]]) -> Plot:
    pitch = PITCHES_HZ[-1]
    curves = []
    for path, (name, sign) in enumerate((("direct sound", 1.0), ("reflection", -1.0))):
        theory = [theory_hz(sign * speed, pitch) - pitch for speed in SPEEDS_MPS]
        measured = [heard[path].frequency_hz - pitch for heard in tones]
        curves.append(Curve(f"{name}, theory", SPEEDS_MPS, theory, Mark.dashes))
        curves.append(Curve(f"{name}, measured", SPEEDS_MPS, measured, Mark.points))
    return Plot(
        f"Shift of {pitch:g} Hz over speed ({receiver})", "speed (m/s)", "shift (Hz)", curves
    )

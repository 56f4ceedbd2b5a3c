"""Rooms: image sources, reverberation time, energy, reciprocity and the inverse-distance law."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.signal

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_most, between, equals
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing import MonoReceiver
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS, Clip, House, Room, SoundField
from veca_marl.sim.sound import room_acoustics as acoustics

SAMPLE_RATE_HZ = 22_050
STEP_SAMPLES = 882
ROOM_M = (8.0, 6.0, 3.0)
UNEQUAL_WALLS = (0.9, 0.4, 0.7, 0.5, 0.3, 0.8)
SOURCE = (2.1, 3.7, 1.2)
HEAD = (5.3, 2.2, 1.6)
REVERBERANT = (((6.0, 5.0, 3.0), 0.8), ((6.0, 5.0, 3.0), 0.9), ((10.0, 8.0, 4.0), 0.8))
REVERBERANT_SOURCE, REVERBERANT_HEAD = (1.3, 2.1, 1.1), (3.9, 3.2, 1.7)
REFERENCE_S = (0.30705, 0.67060, 0.48014)
"""Reverberation times of the rooms `REVERBERANT` by another program, pyroomacoustics 0.10.1
(Scheibler et al. 2018). `tests/fidelity/test_rooms.py` computes them."""

_LOW_PASS = 0.49
_MAX_ORDER = 60


def low_noise(n_samples: int, seed: int = 0) -> Floats:
    """Return noise in the lower half of the band, where the observation lies."""
    white = np.random.default_rng(seed).standard_normal(n_samples + 200)
    filtered: Floats = scipy.signal.lfilter(scipy.signal.firwin(101, _LOW_PASS), 1, white)[200:]
    return filtered


def mirrored_sources(source: Floats, room: Room, order: int) -> list[tuple[Floats, float]]:
    """Return positions and gains of all image sources by repeated reflection in single walls.

    Independent of `image_lattice`: every image is mirrored in each wall again, and images at the
    same position count once (in a rectangular room they have the same gain).
    """
    found: dict[tuple[float, ...], tuple[Floats, float]] = {}
    latest = [(source, 1.0)]
    for _ in range(order + 1):
        following = []
        for position, gain in latest:
            key = tuple(np.round(position, 6))
            if key in found:
                continue
            found[key] = (position, gain)
            for wall in range(6):
                axis = wall // 2
                at = room.lower[axis] + (room.size[axis] if wall % 2 else 0.0)
                image = position.copy()
                image[axis] = 2.0 * at - position[axis]
                following.append((image, gain * float(room.beta[wall])))
        latest = following
    return list(found.values())


def reference_signal(sound: Floats, source: Floats, head: Floats, room: Room, order: int) -> Floats:
    """Return the sound pressure at a point by exact delays of a periodic signal, in float64.

    Args:
        sound: ``(n,)`` one period.
        source: ``(3,)`` metres.
        head: ``(3,)`` metres.
        room: The room.
        order: Greatest number of reflections.
    """
    spectrum = np.fft.rfft(sound)
    frequency = np.fft.rfftfreq(sound.size, 1.0 / SAMPLE_RATE_HZ)
    response = np.zeros(spectrum.size, np.complex128)
    for image, gain in mirrored_sources(source, room, order):
        distance = float(np.linalg.norm(image - head))
        delay_s = distance / SPEED_OF_SOUND_MPS
        response += gain / distance * np.exp(-2j * np.pi * frequency * delay_s)
    return np.fft.irfft(spectrum * response, sound.size)


def streamed_signal(
    sound: Floats, source: Floats, head: Floats, room: Room | House, order: int
) -> Floats:
    """Return what an omnidirectional receiver hears of a sound, ``(n,)``, without the latency."""
    field = SoundField(room, STEP_SAMPLES, SAMPLE_RATE_HZ, order)
    field.add_source("noise", Clip(sound)).position = source
    listener = field.add_listener(MonoReceiver())
    field.reset(np.random.default_rng(0))
    heard = []
    for _ in range(math.ceil((sound.size + field.latency_samples) / STEP_SAMPLES)):
        field.advance()
        heard.append(listener.render(Pose(head, np.eye(3)))[0])
    latency = field.latency_samples
    return np.concatenate(heard).astype(np.float64)[latency : latency + sound.size]


def stream_error_db(order: int) -> float:
    """Return the error of the stream against `reference_signal`, dB relative to the signal."""
    period = low_noise(8 * STEP_SAMPLES)
    room = Room(np.zeros(3), ROOM_M, UNEQUAL_WALLS)
    source, head = np.array(SOURCE), np.array(HEAD)
    heard = streamed_signal(np.tile(period, 2), source, head, room, order)[period.size :]
    expected = reference_signal(period, source, head, room, order)
    return level_db(heard - expected) - level_db(expected)


def level_db(signal: Floats) -> float:
    """Return the level of a signal relative to an rms pressure of 1."""
    return float(10.0 * np.log10(np.mean(signal**2) + 1e-30))


def lattice_error_m(order: int) -> float:
    """Return how far the image sources are from those of repeated mirroring, gains included."""
    room = Room((1.0, -2.0, 0.5), ROOM_M, UNEQUAL_WALLS)
    source = room.lower + np.array(SOURCE)
    lattice = acoustics.image_lattice(order)
    images = acoustics.image_sources(source, room.lower, room.size, lattice)
    ours = np.column_stack([images, acoustics.image_gains(room.beta, lattice)])
    mirrored = mirrored_sources(source, room, order)
    if len(mirrored) != len(ours):
        return math.inf
    theirs = np.array([[*position, gain] for position, gain in mirrored])
    nearest = np.abs(ours[:, None] - theirs[None]).max(axis=-1)
    return float(max(nearest.min(axis=0).max(), nearest.min(axis=1).max()))


def decay_time(response: Floats) -> float:
    """Return the time in s for 60 dB, from -5 to -25 dB (Schroeder 1965; ISO 3382-2, T20)."""
    energy = np.cumsum(response[::-1] ** 2)[::-1]
    level = 10.0 * np.log10(energy / energy[0] + 1e-30)
    part = np.flatnonzero((level <= -5.0) & (level >= -25.0))
    return float(-60.0 / np.polyfit(part / SAMPLE_RATE_HZ, level[part], 1)[0])


def reverberation(size_m: Sequence[float], beta: float) -> tuple[float, float, float]:
    """Return the reverberation time of a room in s: measured, after Eyring, after Sabine."""
    order, n_samples = extent(size_m, beta)
    response = acoustics.room_impulse_response(
        REVERBERANT_SOURCE,
        REVERBERANT_HEAD,
        Room(np.zeros(3), size_m, beta),
        order,
        SAMPLE_RATE_HZ,
        n_samples,
    )
    return (
        reverberation_time(response),
        acoustics.eyring_decay_time(size_m, beta),
        acoustics.sabine_decay_time(size_m, beta),
    )


def extent(size_m: Sequence[float], beta: float) -> tuple[int, int]:
    """Return the order of the image sources and the number of samples of an impulse response."""
    n_samples = int(1.2 * acoustics.eyring_decay_time(size_m, beta) * SAMPLE_RATE_HZ)
    order = math.ceil(n_samples / SAMPLE_RATE_HZ * SPEED_OF_SOUND_MPS / min(size_m))
    return min(order, _MAX_ORDER), n_samples


def reverberation_time(response: Floats) -> float:
    """Return the reverberation time in s of an impulse response, above 100 Hz.

    Positive reflection coefficients accumulate constant pressure (Allen & Berkley 1979).
    """
    high_pass = scipy.signal.butter(2, 100.0, "highpass", fs=SAMPLE_RATE_HZ, output="sos")
    return decay_time(scipy.signal.sosfilt(high_pass, response))


def level_over_distance(distances_m: Sequence[float]) -> list[float]:
    """Return the levels in dB at some distances from a source of level 1 in the free field."""
    field = SoundField(None, STEP_SAMPLES, SAMPLE_RATE_HZ)
    sound = low_noise(20 * STEP_SAMPLES)
    sound /= np.sqrt(np.mean(sound**2))
    field.add_source("noise", Clip(sound))
    listeners = [field.add_listener(MonoReceiver()) for _ in distances_m]
    field.reset(np.random.default_rng(0))
    heard: list[list[Floats]] = [[] for _ in distances_m]
    for _ in range(20):
        field.advance()
        for listener, distance_m, signal in zip(listeners, distances_m, heard, strict=True):
            signal.append(listener.render(Pose(np.array([distance_m, 0.0, 0.0]), np.eye(3)))[0])
    levels = []
    for distance_m, signal in zip(distances_m, heard, strict=True):
        delay = round(distance_m / SPEED_OF_SOUND_MPS * SAMPLE_RATE_HZ) + field.latency_samples
        levels.append(level_db(np.concatenate(signal).astype(np.float64)[delay + 50 :]))
    return levels


def reciprocity_error_db(room: Room | House, one: Floats, other: Floats, order: int) -> float:
    """Return how much is changed by exchanging source and receiver, dB relative to the signal."""
    sound = low_noise(6 * STEP_SAMPLES)
    there = streamed_signal(sound, one, other, room, order)
    back = streamed_signal(sound, other, one, room, order)
    return level_db(there - back) - level_db(there)


def diffuse_level_error_db(size_m: Sequence[float], beta: float, order: int) -> float:
    """Return by how much the level in a room differs from that of the diffuse field, dB.

    Energies of all image sources are added, and averaged over pairs of places; the theory is
    direct sound plus ``16 pi / R`` with the room constant ``R = S a / (1 - a)`` (Kuttruff 2016,
    section 5.6).
    """
    room = Room(np.zeros(3), size_m, beta)
    lattice = acoustics.image_lattice(order)
    gains = acoustics.image_gains(room.beta, lattice)
    rng = np.random.default_rng(0)
    measured, direct = [], []
    for one, other in rng.uniform(0.15, 0.85, (24, 2, 3)) * room.size:
        images = acoustics.image_sources(one, room.lower, room.size, lattice)
        squared = ((images - other) ** 2).sum(axis=1)
        measured.append((gains**2 / squared).sum())
        direct.append(1.0 / squared[0])
    x, y, z = size_m
    absorption = 1.0 - beta**2
    constant = 2.0 * (x * y + y * z + z * x) * absorption / (1.0 - absorption)
    reverberant = np.mean(np.array(measured) - np.array(direct))
    return float(10.0 * np.log10(reverberant / (16.0 * np.pi / constant)))


def section() -> Section:
    """Measure rooms for the page."""
    text = (
        "Image sources (Allen & Berkley 1979) against repeated mirroring in single walls; the "
        "streamed sound against exact delays in float64; reverberation time from the backward "
        "integrated impulse response (T20) against Sabine and Eyring, which differ: an image "
        "model of a rectangular room is not diffuse, and against another program with image "
        "sources, pyroomacoustics 0.10.1 (Scheibler et al. 2018). Energy against the diffuse "
        "field, exchange of source and receiver, and level over distance in the free field."
    )
    room = Room(np.zeros(3), ROOM_M, UNEQUAL_WALLS)
    distances = [0.25 * 2.0**i for i in range(9)]
    levels = level_over_distance(distances)
    theory = [-20.0 * math.log10(distance) for distance in distances]
    inverse = max(abs(level - expected) for level, expected in zip(levels, theory, strict=True))
    reciprocity = reciprocity_error_db(room, np.array(SOURCE), np.array(HEAD), 3)
    laws = [
        at_most("image sources, order 5, against mirroring", "m", 1e-9, lattice_error_m(5)),
        *(
            at_most(f"stream, order {order}, against float64", "dB", -45.0, stream_error_db(order))
            for order in (0, 1, 2, 3)
        ),
        at_most("source and receiver exchanged, order 3", "dB", -80.0, reciprocity),
        at_most("inverse-distance law, 0.25 to 64 m, largest error", "dB", 0.1, inverse),
        between(
            "reverberant energy against the diffuse field, 6 x 5 x 3 m, beta 0.8",
            "dB", -2.0, 2.0, diffuse_level_error_db((6.0, 5.0, 3.0), 0.8, 40),
        ),
    ]  # fmt: skip
    times = [reverberation(size, beta) for size, beta in REVERBERANT]
    for case, time, reference_s in zip(REVERBERANT, times, REFERENCE_S, strict=True):
        laws += [_reverberation_law(*case, *time), reference_law(*case, time[0], reference_s)]
    return Section(
        "Rooms", text, laws, [_decay_plot(times), _distance_plot(distances, levels, theory)]
    )


def _reverberation_law(
    size: Sequence[float], beta: float, measured: float, eyring: float, sabine: float
) -> Law:
    return between(
        f"{_name(size, beta)}: between 0.9 Eyring ({eyring:.2f}) and 1.15 Sabine ({sabine:.2f})",
        "s", 0.9 * eyring, 1.15 * sabine, measured,
    )  # fmt: skip


def reference_law(size: Sequence[float], beta: float, measured: float, reference_s: float) -> Law:
    """Return the law that a reverberation time is within 1 % of that of another program."""
    name = f"{_name(size, beta)}: pyroomacoustics"
    return equals(name, "s", reference_s, measured, 0.01 * reference_s)


def _name(size: Sequence[float], beta: float) -> str:
    return f"reverberation time, {' x '.join(f'{s:g}' for s in size)} m, beta {beta:g}"


def _decay_plot(times: Sequence[tuple[float, float, float]]) -> Plot:
    rooms = [f"{' x '.join(f'{s:g}' for s in size)} m, {beta:g}" for size, beta in REVERBERANT]
    curves = [
        Curve(name, rooms, [time[i] for time in times], mark)
        for i, (name, mark) in enumerate(
            (("measured", Mark.bars), ("Eyring", Mark.points), ("Sabine", Mark.points))
        )
    ]
    curves.append(Curve("pyroomacoustics", rooms, REFERENCE_S, Mark.points))
    return Plot("Reverberation time", "room and reflection coefficient", "T20 (s)", curves)


def _distance_plot(
    distances: Sequence[float], levels: Sequence[float], theory: Sequence[float]
) -> Plot:
    curves = [
        Curve("theory", distances, theory, Mark.dashes),
        Curve("measured", distances, levels, Mark.points),
    ]
    return Plot("Level over distance", "distance (m)", "level (dB)", curves, log_x=True)

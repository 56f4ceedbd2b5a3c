"""Filters that give the sound of each path its level in octave bands, applied while it is read."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled, inlined, kernel
from veca_marl.sim.sound.partitions import BANDS_HZ, N_BANDS
from veca_marl.sim.sound.signal_paths import copy_samples, read_moving

SETTLING_SAMPLES = 512
"""After so many samples what a filter has not heard of the past is below -80 dB."""

_SILENT = np.float32(1e-8)
"""First coefficient of a filter below which nothing is heard; paths that do not exist have
-180 dB."""

Sections = NDArray[np.float32]

_RIDGE = 0.03  # of the fit: the smallest with errors below 1 dB behind one and two walls
_LEAST = 1e-18  # energy, -180 dB


class ShelfDesign(NamedTuple):
    """What the filters of `shelf_filters` depend on beside the energies.

    Attributes:
        fit: ``(N_BANDS, N_BANDS)``: the gain and the steps in dB by the levels in the bands.
        crossovers: ``(N_BANDS - 1,)`` tangents of half of the angular frequencies between bands.
    """

    fit: Floats
    crossovers: Floats


@cache
def shelf_design(sample_rate_hz: float) -> ShelfDesign:
    """Return the numbers for a sampling rate; bands above 0.4 of it have the last level below."""
    between_hz = np.minimum(np.sqrt(BANDS_HZ[1:] * BANDS_HZ[:-1]), 0.4 * sample_rate_hz)
    crossovers: Floats = np.tan(np.pi * between_hz / sample_rate_hz)
    middles_hz = np.minimum(BANDS_HZ, 0.45 * sample_rate_hz)
    middles = np.tan(np.pi * middles_hz / sample_rate_hz)
    shapes = 1.0 / (1.0 + (crossovers / middles[:, None]) ** 2)
    response = np.column_stack([np.ones(N_BANDS), shapes])
    differences = np.eye(N_BANDS) - np.eye(N_BANDS, k=-1)
    normal = response.T @ response + _RIDGE * np.eye(N_BANDS)
    fit: Floats = np.linalg.solve(normal, response.T + _RIDGE * differences).T.astype(np.float64)
    return ShelfDesign(fit, crossovers)


@compiled
def shelf_filters(energy: Floats, design: ShelfDesign) -> NDArray[np.float32]:
    """Return filters with given energies in the octave bands.

    A gain and first-order shelves, one between each two bands; a step of a shelf is proportional to
    its level in dB at all frequencies to first order (Jot 2015, Proportional parametric equalizers,
    AES Convention 139), so that the steps follow from the levels by one matrix. The errors are
    below 0.7 dB at the middles of the bands behind one wall or one edge. Filters have minimum
    phase: they add no delay.

    Args:
        energy: ``(K, N_BANDS)`` from 0 to 1.
        design: See `shelf_design`.

    Returns:
        ``(K, N_BANDS - 1, 3)``: coefficients b0, b1 and a1 of each section; the gain is in the
        first.
    """
    fit, crossovers = design.fit, design.crossovers
    sections = np.empty((len(energy), N_BANDS - 1, 3), np.float32)
    levels = np.empty(N_BANDS)
    for k in range(energy.shape[0]):
        for band in range(N_BANDS):
            levels[band] = 0.5 * math.log(max(energy[k, band], _LEAST))
        gain = 0.0
        for band in range(N_BANDS):
            gain += levels[band] * fit[band, 0]
        gain = math.exp(gain)
        for s in range(N_BANDS - 1):
            step = 0.0
            for band in range(N_BANDS):
                step += levels[band] * fit[band, s + 1]
            step = math.exp(step)
            pole = math.sqrt(step) * crossovers[s]
            sections[k, s, 0] = gain * (step + pole) / (1.0 + pole)
            sections[k, s, 1] = gain * (pole - step) / (1.0 + pole)
            sections[k, s, 2] = (pole - 1.0) / (1.0 + pole)
            gain = 1.0
    return sections


def unshaded(n_paths: int) -> NDArray[np.float32]:
    """Return filters that change nothing, in the form of `shelf_filters`."""
    sections = np.zeros((n_paths, N_BANDS - 1, 3), np.float32)
    sections[..., 0] = 1.0
    return sections


@kernel
def is_unity(sections: Sections) -> bool:
    """Return whether sections ``(S, 3)``, see `shelf_filters`, change nothing."""
    for s in range(sections.shape[0]):
        if sections[s, 0] != np.float32(1.0) or sections[s, 1] != sections[s, 2]:
            return False
    return True


@kernel
def shade(
    signal: NDArray[np.float32], before: Sections, after: Sections, state: NDArray[np.float32]
) -> None:
    """Filter a signal by first-order sections that change linearly.

    Args:
        signal: ``(n,)``, overwritten.
        before: ``(S, 3)`` coefficients before the first sample; S is a multiple of 3.
        after: ``(S, 3)`` coefficients at the last sample.
        state: ``(S,)`` of the sections; overwritten.
    """
    for s in range(0, len(before), 3):
        _shade_three(signal, before[s : s + 3], after[s : s + 3], state[s : s + 3])


@kernel
def _shade_three(
    signal: NDArray[np.float32], before: Sections, after: Sections, state: NDArray[np.float32]
) -> None:
    """Filter a signal by three sections at once: their recursions overlap in time.

    Args:
        signal: See `shade`.
        before: ``(3, 3)`` coefficients before the first sample.
        after: ``(3, 3)`` coefficients at the last sample.
        state: ``(3,)``, overwritten.
    """
    n = np.float32(len(signal))
    b0, b1, a1, db0, db1, da1 = _ramp(before[0], after[0], n)
    c0, c1, d1, dc0, dc1, dd1 = _ramp(before[1], after[1], n)
    e0, e1, f1, de0, de1, df1 = _ramp(before[2], after[2], n)
    r, s, t = state[0], state[1], state[2]
    for i in range(len(signal)):
        b0, b1, a1 = b0 + db0, b1 + db1, a1 + da1
        c0, c1, d1 = c0 + dc0, c1 + dc1, d1 + dd1
        e0, e1, f1 = e0 + de0, e1 + de1, f1 + df1
        x = signal[i]
        y = b0 * x + r
        r = b1 * x - a1 * y
        z = c0 * y + s
        s = c1 * y - d1 * z
        w = e0 * z + t
        t = e1 * z - f1 * w
        signal[i] = w
    state[0], state[1], state[2] = r, s, t


@inlined
def _ramp(
    before: NDArray[np.float32], after: NDArray[np.float32], n: np.float32
) -> tuple[float, float, float, float, float, float]:
    """Return three coefficients ``(3,)`` and by how much each changes per sample of n."""
    b0, b1, a1 = before[0], before[1], before[2]
    return b0, b1, a1, (after[0] - b0) / n, (after[1] - b1) / n, (after[2] - a1) / n


@kernel
def read_shaded_block(
    powers: NDArray[np.float32],
    start: int,
    end: int,
    before: Floats,
    after: Floats,
    n_samples: int,
    ends: NDArray[np.float32],
    signals: NDArray[np.float32],
    sections: tuple[Sections, Sections],
    states: NDArray[np.float32],
) -> None:
    """Write the blocks of all paths and channels as `read_block` does, filtered.

    Args:
        powers: See `read_block`.
        start: Likewise.
        end: Likewise.
        before: Likewise.
        after: Likewise.
        n_samples: Likewise.
        ends: Likewise.
        signals: Likewise.
        sections: ``(K, S, 3)`` filters of each path before the first of the new samples, and at the
            last of them.
        states: ``(K, C, S)`` of the filters; overwritten.
    """
    kept = signals.shape[2] - n_samples
    for k in range(signals.shape[0]):
        silent = max(abs(sections[0][k, 0, 0]), abs(sections[1][k, 0, 0])) < _SILENT
        unchanged = silent or (is_unity(sections[0][k]) and is_unity(sections[1][k]))
        if unchanged:
            states[k] = np.float32(0.0)
        for channel in range(signals.shape[1]):
            signal, last = signals[k, channel], ends[k, channel]
            copy_samples(last, signal[:kept])
            new = signal[kept:]
            if silent:
                new[:] = np.float32(0.0)
            else:
                read_moving(powers, start, end, before[k, channel], after[k, channel], new)
            if not unchanged:
                shade(new, sections[0][k], sections[1][k], states[k, channel])
            copy_samples(signal[signal.shape[0] - last.shape[0] :], last)


@compiled
def settle(
    powers: NDArray[np.float32],
    start: int,
    end: int,
    delays: Floats,
    sections: Sections,
    states: NDArray[np.float32],
) -> None:
    """Set the states of filters to those after the samples before a block.

    Args:
        powers: See `read_moving`.
        start: Likewise.
        end: Column after the last of these samples.
        delays: ``(K, C)`` samples.
        sections: ``(K, S, 3)`` filters of each path.
        states: ``(K, C, S)``, overwritten.
    """
    past = np.empty((*delays.shape, SETTLING_SAMPLES), np.float32)
    ends = np.empty((*delays.shape, 0), np.float32)
    states[:] = np.float32(0.0)
    read_shaded_block(
        powers,
        start,
        end,
        delays,
        delays,
        SETTLING_SAMPLES,
        ends,
        past,
        (sections, sections),
        states,
    )

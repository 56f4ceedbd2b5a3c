"""Filters of what obstacles leave of the sound of each path, applied while it is read."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.delay_lines import read_moving

SETTLING_SAMPLES = 512
"""After so many samples what a filter has not heard of the past is below -80 dB."""

_SILENT = np.float32(1e-8)
"""First coefficient of a filter below which nothing is heard: paths that do not exist have -180
dB."""

Sections = NDArray[np.float32]


@njit(cache=True, error_model="numpy")
def is_unity(sections: Sections) -> bool:
    """Return whether sections ``(S, 3)``, see `shelf_filters`, change nothing."""
    for s in range(sections.shape[0]):
        if sections[s, 0] != np.float32(1.0) or sections[s, 1] != sections[s, 2]:
            return False
    return True


@njit(cache=True, error_model="numpy")
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
    per_sample = (after - before) / np.float32(len(signal))
    for s in range(0, len(before), 3):
        _shade_three(signal, before[s : s + 3], per_sample[s : s + 3], state[s : s + 3])


@njit(cache=True, error_model="numpy")
def _shade_three(
    signal: NDArray[np.float32], before: Sections, slope: Sections, state: NDArray[np.float32]
) -> None:
    """Filter a signal by three sections at once: their recursions overlap in time.

    Args:
        signal: See `shade`.
        before: ``(3, 3)`` coefficients before the first sample.
        slope: ``(3, 3)`` by which they change per sample.
        state: ``(3,)``, overwritten.
    """
    b0, b1, a1 = before[0]
    c0, c1, d1 = before[1]
    e0, e1, f1 = before[2]
    db0, db1, da1 = slope[0]
    dc0, dc1, dd1 = slope[1]
    de0, de1, df1 = slope[2]
    r, s, t = state
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


@njit(cache=True, error_model="numpy")
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
            signal = signals[k, channel]
            signal[:kept] = ends[k, channel, :kept]
            new = signal[kept:]
            if silent:
                new[:] = np.float32(0.0)
            else:
                read_moving(powers, start, end, before[k, channel], after[k, channel], new)
            if not unchanged:
                shade(new, sections[0][k], sections[1][k], states[k, channel])
    ends[:] = signals[:, :, signals.shape[2] - ends.shape[2] :]


@njit(cache=True, error_model="numpy")
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

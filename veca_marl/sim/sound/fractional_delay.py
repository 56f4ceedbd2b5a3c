"""Fractional delays: a bank of windowed sinc kernels, and reading with a moving delay."""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

HALF_WIDTH = 8
KERNEL_TAPS = 2 * HALF_WIDTH
KERNEL_LATENCY = HALF_WIDTH - 1
PHASES = 256
_KAISER_BETA = 9.0


@cache
def kernel_bank() -> NDArray[np.float32]:
    """Return the interpolation kernels, Kaiser-windowed sincs (Laakso et al. 1996, section 3).

    Linear interpolation between neighbouring rows is exact to -104 dB.

    Returns:
        ``(PHASES + 1, KERNEL_TAPS)``, read-only. Row ``p`` reads ``x(t + p / PHASES)`` from
        ``x[t - 7 .. t + 8]``; as a filter it delays by ``KERNEL_LATENCY + p / PHASES`` samples.
    """
    taps = np.arange(KERNEL_TAPS) - KERNEL_LATENCY
    offset = taps[None, :] - np.arange(PHASES + 1)[:, None] / PHASES
    inside = np.sqrt(np.clip(1.0 - (offset / HALF_WIDTH) ** 2, 0.0, 1.0))
    bank = np.sinc(offset) * np.i0(_KAISER_BETA * inside) / np.i0(_KAISER_BETA)
    unit_gain: NDArray[np.float32] = (bank / bank.sum(axis=1, keepdims=True)).astype(np.float32)
    unit_gain.setflags(write=False)
    return unit_gain


@njit(cache=True)
def fractional_kernel(bank: NDArray[np.float32], fraction: float, out: NDArray[np.float32]) -> None:
    """Write the kernel for a fraction of a sample in [0, 1) to `out`, ``(KERNEL_TAPS,)``."""
    phase = fraction * PHASES
    row = min(int(phase), PHASES - 1)
    weight = np.float32(phase - row)
    for tap in range(KERNEL_TAPS):
        out[tap] = bank[row, tap] + weight * (bank[row + 1, tap] - bank[row, tap])


@njit(cache=True)
def read_delayed(
    history: NDArray[np.float32],
    delay_before: float,
    delay_after: float,
    bank: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Read the newest ``len(out)`` samples of a source through a delay that changes linearly.

    The changing delay is the Doppler effect. The delay is that of the distance at the time of
    arrival: exact for a moving listener, and for a moving source up to ``(v / c)^2``, 0.1 % of the
    pitch at 10 m/s.

    Args:
        history: Emitted samples, newest last. Samples before them count as silence.
        delay_before: Delay in samples at the end of the last step, not negative.
        delay_after: Delay in samples at the end of this step, not negative.
        bank: `kernel_bank`.
        out: ``(n,)`` the delayed signal, written; delayed by further `HALF_WIDTH` samples.
    """
    n = out.shape[0]
    first = history.shape[0] - n - HALF_WIDTH
    slope = (delay_after - delay_before) / n
    for i in range(n):
        position = first + i - (delay_before + slope * (i + 1))
        whole = int(np.floor(position))
        phase = (position - whole) * PHASES
        row = min(int(phase), PHASES - 1)
        weight = np.float32(phase - row)
        start = whole - KERNEL_LATENCY
        total = np.float32(0.0)
        if start >= 0:
            for tap in range(KERNEL_TAPS):
                coefficient = bank[row, tap] + weight * (bank[row + 1, tap] - bank[row, tap])
                total += coefficient * history[start + tap]
        out[i] = total

"""Signals on their way: delay lines, from which paths read, and mixers, which filter and add them.

Delay lines hold the last samples of a signal, read at any delay that may change. The interpolation
kernels are Kaiser-windowed sincs (Laakso et al. 1996, section 3), and each of their taps is a
polynomial of the fraction of a sample (Farrow 1988, A continuously variable digital delay element).
A signal is filtered once by the coefficients of equal power; each further read at any delay
evaluates a polynomial per sample.

A path has one filter at the end of each control step. Over a step, the output of the filter of the
last step is faded linearly into that of this step. A filter contains no propagation delay, so that
a fade between neighbouring directions does not cause comb filtering.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel

HALF_WIDTH = 8
KERNEL_TAPS = 2 * HALF_WIDTH
DEGREE = 5
"""Degree of the polynomials. Up to 5.4 kHz at 22 050 Hz they follow the kernels to -95 dB."""

_BEFORE = HALF_WIDTH - 1
_KAISER_BETA = 9.0
_FITTED_FRACTIONS = 257

_SHIFT_EVERY = 4096


def interpolation_kernels(fraction: Floats) -> Floats:
    """Return kernels that read a signal between two samples.

    Args:
        fraction: ``(P,)`` fractions of a sample in [0, 1].

    Returns:
        ``(P, KERNEL_TAPS)``: row p reads ``x(t + fraction[p])`` from ``x[t - 7 .. t + 8]``. The
        gain at frequency 0 is 1.
    """
    offset = np.arange(KERNEL_TAPS) - _BEFORE - fraction[:, None]
    inside = np.sqrt(np.clip(1.0 - (offset / HALF_WIDTH) ** 2, 0.0, 1.0))
    kernels = np.sinc(offset) * np.i0(_KAISER_BETA * inside) / np.i0(_KAISER_BETA)
    unit_gain: Floats = kernels / kernels.sum(axis=1, keepdims=True)
    return unit_gain


@cache
def farrow_coefficients() -> NDArray[np.float32]:
    """Return the filters of a Farrow structure.

    Returns:
        ``(DEGREE + 1, KERNEL_TAPS)``, read-only: tap t of the kernel for a fraction mu is the sum
        over m of ``coefficients[m, t] * (2 mu - 1) ** m``.
    """
    fraction = np.linspace(0.0, 1.0, _FITTED_FRACTIONS)
    powers = np.vander(2.0 * fraction - 1.0, DEGREE + 1, increasing=True)
    # the fit is linear, so that the gain at frequency 0 stays 1 for every fraction
    fitted = np.linalg.lstsq(powers, interpolation_kernels(fraction), rcond=None)[0]
    coefficients: NDArray[np.float32] = np.ascontiguousarray(fitted, dtype=np.float32)
    coefficients.setflags(write=False)
    return coefficients


@kernel
def filter_powers(
    samples: NDArray[np.float32],
    coefficients: NDArray[np.float32],
    out: NDArray[np.float32],
    column: int,
) -> None:
    """Filter a signal by the coefficients of each power.

    Args:
        samples: ``(n + KERNEL_TAPS - 1,)``.
        coefficients: `farrow_coefficients`.
        out: ``(DEGREE + 1, size)``; n columns are overwritten.
        column: The first of these; it belongs to ``samples[7]``.
    """
    n = samples.shape[0] - KERNEL_TAPS + 1
    for m in range(out.shape[0]):
        row = out[m, column : column + n]
        row[:] = np.float32(0.0)
        for tap in range(0, KERNEL_TAPS, 4):  # four at once: fewer loads and stores of the row
            c0, c1, c2, c3 = coefficients[m, tap : tap + 4]
            for i in range(n):
                t = tap + i
                total = row[i] + c0 * samples[t] + c1 * samples[t + 1]
                row[i] = total + c2 * samples[t + 2] + c3 * samples[t + 3]


@kernel
def read_moving(
    powers: NDArray[np.float32],
    start: int,
    end: int,
    delay_before: float,
    delay_after: float,
    out: NDArray[np.float32],
) -> None:
    """Read the last ``len(out)`` samples through a delay that changes linearly.

    The changing delay is the Doppler effect. The delay is that of the distance at the time of
    arrival: exact for a moving listener, and for a moving source up to ``(v / c)^2``, 0.1 % of the
    pitch at 10 m/s.

    Args:
        powers: ``(DEGREE + 1, size)`` the signal, see `filter_powers`.
        start: First column to read; those before count as silence.
        end: Column after the newest.
        delay_before: Delay in samples at the sample before the first of `out`, not negative.
        delay_after: Delay in samples at the last sample of `out`, not negative.
        out: ``(n,)``, overwritten.
    """
    n = out.shape[0]
    slope = (delay_after - delay_before) / n
    i = 0
    while i < n:
        # no sum with `end`: its rounding would depend on where the samples are stored
        delay = delay_before + slope * (i + 1)
        whole = int(np.ceil(delay))
        fraction = whole - delay
        run = n - i  # samples until the whole part of the delay changes
        if slope > 0.0:
            run = min(run, int(min(fraction / slope, float(n))) + 1)  # the ratio has no limit
        elif slope < 0.0:
            run = min(run, int(min((1.0 - fraction) / -slope, float(n))) + 1)
        first = end - n + i - whole
        part = out[i : i + run]
        if first < start:
            silent = min(run, start - first)
            part[:silent] = np.float32(0.0)
            i += silent
            continue
        p0, p1 = powers[0, first : first + run], powers[1, first : first + run]
        p2, p3 = powers[2, first : first + run], powers[3, first : first + run]
        p4, p5 = powers[4, first : first + run], powers[5, first : first + run]
        u0, du = np.float32(2.0 * fraction - 1.0), np.float32(-2.0 * slope)
        for j in range(run):
            u = u0 + du * np.float32(j)
            part[j] = p0[j] + u * (p1[j] + u * (p2[j] + u * (p3[j] + u * (p4[j] + u * p5[j]))))
        i += run


@kernel
def copy_samples(samples: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Copy the first ``len(out)`` samples; the assignment of a slice would create an array."""
    for i in range(out.shape[0]):
        out[i] = samples[i]


class SignalMemory:
    """The last samples of a signal. Reads are late by `HALF_WIDTH` samples.

    Attributes:
        n_samples: How many samples it holds.
        powers: ``(DEGREE + 1, size)`` float32, see `filter_powers`.
        end: Column of `powers` after the newest sample.
    """

    def __init__(self, n_samples: int) -> None:
        self.n_samples = n_samples
        self.clear()

    def clear(self) -> None:
        """Replace all samples by silence."""
        # columns beyond n_samples are free: samples move to the front when these are used up
        size = self.n_samples + _SHIFT_EVERY
        self.powers: NDArray[np.float32] = np.zeros((DEGREE + 1, size), np.float32)
        self.end = self.n_samples
        self._newest: NDArray[np.float32] = np.zeros(KERNEL_TAPS - 1, np.float32)

    def extend(self, n_samples: int) -> None:
        """Hold at least so many samples from now on; those that are not held count as silence."""
        if n_samples <= self.n_samples:
            return
        stored = self.powers[:, self.end - self.n_samples : self.end]
        self.n_samples, newest = n_samples, self._newest
        self.clear()
        self.powers[:, self.end - stored.shape[1] : self.end] = stored
        self._newest = newest

    def append(self, samples: NDArray[np.float32]) -> None:
        """Store the next samples ``(n,)``; the oldest are dropped."""
        n = samples.size
        if self.end + n > self.powers.shape[1]:
            self._move_to_front(n)
        extended = np.concatenate((self._newest, samples))
        filter_powers(extended, farrow_coefficients(), self.powers, self.end)
        self.end += n
        self._newest = extended[n:]

    def _move_to_front(self, n: int) -> None:
        kept = self.powers[:, self.end - self.n_samples : self.end].copy()
        if self.n_samples + n > self.powers.shape[1]:
            self.powers = np.zeros((DEGREE + 1, self.n_samples + n), np.float32)
        self.powers[:, : self.n_samples] = kept
        self.end = self.n_samples


Signals = NDArray[np.float32]
Response = NDArray[Any]


class Mixer(Protocol):
    """Filters signals of paths and adds them.

    Attributes:
        block_samples: How many samples of a path are filtered at once, those of the step last.
    """

    block_samples: int

    def response(self, filters: NDArray[np.float32]) -> Response:
        """Return filters ``(K, C, block_samples)``, zero after their taps, as `add` takes them."""
        ...

    def add(self, signals: Signals, before: Response | None, after: Response | None) -> None:
        """Filter the signals of some paths and add them to the step.

        Args:
            signals: ``(K, C, block_samples)``.
            before: Filters at the beginning of the step; None for paths that begin in it. The same
                object as `after` where nothing changes.
            after: Filters at the end of the step; None for paths that end in it.
        """
        ...

    def add_changed(self, blocks: Signals, response: Response) -> None:
        """Filter the signals of some paths by filters that change to new ones, and add them.

        Args:
            blocks: ``(2, K, C, block_samples)``: the signals, and the filters at the end of the
                step in the form that `response` takes.
            response: Filters at the beginning of the step; overwritten by those at its end.
        """
        ...

    def finish(self) -> Signals:
        """Return the sum ``(C, n)`` since the last call, and begin with the next step."""
        ...


def make_mixer(n_channels: int, n_taps: int, step_samples: int) -> Mixer:
    """Return the cheapest mixer for filters of a length."""
    if n_taps == 1:
        return GainMixer(n_channels, step_samples)
    return SpectralMixer(n_channels, n_taps, step_samples)


class GainMixer:
    """Paths with a gain each and no filter."""

    def __init__(self, n_channels: int, step_samples: int) -> None:
        self.block_samples = step_samples
        self._sum: Signals = np.zeros((n_channels, step_samples), np.float32)

    def response(self, filters: NDArray[np.float32]) -> Response:
        """See `Mixer`."""
        return filters[:, :, 0].copy()

    def add(self, signals: Signals, before: Response | None, after: Response | None) -> None:
        """See `Mixer`."""
        none = np.zeros(signals.shape[:2], np.float32)
        _add_faded(
            signals,
            none if before is None else before,
            none if after is None else after,
            self._sum,
        )

    def add_changed(self, blocks: Signals, response: Response) -> None:
        """See `Mixer`."""
        after = self.response(blocks[1])
        _add_faded(blocks[0], response, after, self._sum)
        response[:] = after

    def finish(self) -> Signals:
        """See `Mixer`."""
        mixed, self._sum = self._sum, np.zeros_like(self._sum)
        return mixed


class SpectralMixer:
    """Paths with a filter each, by multiplication of spectra (overlap-save)."""

    def __init__(self, n_channels: int, n_taps: int, step_samples: int) -> None:
        self.block_samples: int = scipy.fft.next_fast_len(step_samples + n_taps - 1, real=True)
        self._n = step_samples
        self._fade = np.arange(1, step_samples + 1, dtype=np.float32) / np.float32(step_samples)
        shape = (3, n_channels, self.block_samples // 2 + 1)
        self._sums: NDArray[np.complex64] = np.zeros(shape, np.complex64)
        self._faded = False

    def response(self, filters: NDArray[np.float32]) -> Response:
        """See `Mixer`."""
        spectra: NDArray[np.complex64] = scipy.fft.rfft(filters)
        return spectra

    def add(self, signals: Signals, before: Response | None, after: Response | None) -> None:
        """See `Mixer`."""
        spectra = scipy.fft.rfft(signals)
        constant, old, new = self._sums
        if before is after and after is not None:
            _add_products(spectra, after, constant)
            return
        self._faded = True
        if before is not None:
            _add_products(spectra, before, old)
        if after is not None:
            _add_products(spectra, after, new)

    def add_changed(self, blocks: Signals, response: Response) -> None:
        """See `Mixer`."""
        # one call: its overhead is that of three transforms
        spectra, after = scipy.fft.rfft(blocks)
        _, old, new = self._sums
        _add_changed_products(spectra, response, after, old, new)
        self._faded = True

    def finish(self) -> Signals:
        """See `Mixer`."""
        constant, old, new = self._sums
        if not self._faded:
            mixed: Signals = scipy.fft.irfft(constant, self.block_samples)[:, -self._n :]
        else:
            both = np.stack([old + constant, new + constant])
            before, after = scipy.fft.irfft(both, self.block_samples)[..., -self._n :]
            mixed = before + (after - before) * self._fade
        self._sums[:] = 0.0
        self._faded = False
        return mixed


@kernel
def _add_products(
    spectra: NDArray[np.complex64], filters: NDArray[np.complex64], out: NDArray[np.complex64]
) -> None:
    """Add ``spectra * filters``, both ``(K, C, F)``, over all paths to `out`, ``(C, F)``."""
    for k in range(spectra.shape[0]):
        for channel in range(spectra.shape[1]):
            signal, response, total = spectra[k, channel], filters[k, channel], out[channel]
            for f in range(total.shape[0]):
                total[f] += signal[f] * response[f]


@kernel
def _add_changed_products(
    spectra: NDArray[np.complex64],
    before: NDArray[np.complex64],
    after: NDArray[np.complex64],
    old: NDArray[np.complex64],
    new: NDArray[np.complex64],
) -> None:
    """Add ``spectra * before`` to `old` and ``spectra * after`` to `new`; see `_add_products`.

    `before` is overwritten by `after`.
    """
    for k in range(spectra.shape[0]):
        for channel in range(spectra.shape[1]):
            signal, first, last = spectra[k, channel], before[k, channel], after[k, channel]
            total_old, total_new = old[channel], new[channel]
            for f in range(signal.shape[0]):
                total_old[f] += signal[f] * first[f]
                total_new[f] += signal[f] * last[f]
                first[f] = last[f]


@kernel
def _add_faded(
    signals: Signals,
    before: NDArray[np.float32],
    after: NDArray[np.float32],
    out: Signals,
) -> None:
    """Add signals ``(K, C, n)`` with gains ``(K, C)`` that change linearly to `out`, ``(C, n)``."""
    n = out.shape[1]
    for k in range(signals.shape[0]):
        for channel in range(signals.shape[1]):
            first = before[k, channel]
            slope = (after[k, channel] - first) / np.float32(n)
            signal, total = signals[k, channel], out[channel]
            for i in range(n):
                total[i] += (first + slope * np.float32(i + 1)) * signal[i]

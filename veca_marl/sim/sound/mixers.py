"""Filtering of the sound of all paths to one listener, and their sum.

A path has one filter at the end of each control step. Over a step, the output of the filter of the
last step is faded linearly into that of this step. A filter contains no propagation delay, so that
a fade between neighbouring directions does not cause comb filtering.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray

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


@njit(cache=True, error_model="numpy")
def _add_products(
    spectra: NDArray[np.complex64], filters: NDArray[np.complex64], out: NDArray[np.complex64]
) -> None:
    """Add ``spectra * filters``, both ``(K, C, F)``, over all paths to `out`, ``(C, F)``."""
    for k in range(spectra.shape[0]):
        for channel in range(spectra.shape[1]):
            signal, response, total = spectra[k, channel], filters[k, channel], out[channel]
            for f in range(total.shape[0]):
                total[f] += signal[f] * response[f]


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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

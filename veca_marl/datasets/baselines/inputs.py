"""What the network of a baseline reads: stored fields in the form that agents observe them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from veca_marl.algos.specs import ArrayLayout
from veca_marl.datasets.storage import StoredDataset
from veca_marl.sim.hearing.encodings import (
    WINDOW_SAMPLES,
    Encoding,
    Window,
    make_encoder,
)

_CHUNK = 500  # samples that are converted at once
AUDIO_WINDOWS = 4
"""Windows of sound that the network reads, evenly spaced over a recording."""
TOUCH_FRAMES = 16
"""Moments of touch that the network reads, evenly spaced over a recording."""


@dataclass(frozen=True)
class NetworkInput:
    """An input of all samples.

    Attributes:
        array: ``[n, *shape]``.
        layout: Layout of one sample.
    """

    array: Tensor
    layout: ArrayLayout


Prepare = Callable[[StoredDataset, str], NetworkInput]


def as_stored(stored: StoredDataset, name: str) -> NetworkInput:
    """Return a field as it is."""
    field = stored.plan.fields[name]
    return NetworkInput(
        stored.data[name], ArrayLayout(field.shape, field.dtype, field.low, field.high)
    )


def spectra(stored: StoredDataset, name: str) -> NetworkInput:
    """Return `AUDIO_WINDOWS` observations of waveforms: magnitudes and interaural phases.

    The encoding is that of ``senses.audio.encoding=magnitude_phase``, of 1024 samples each.
    """
    waveforms = stored.data[name]
    encoder = make_encoder(Encoding.magnitude_phase, Window.rectangular, None, 250)
    starts = np.linspace(0, waveforms.shape[-1] - WINDOW_SAMPLES, AUDIO_WINDOWS).round().astype(int)
    shape = (AUDIO_WINDOWS, *encoder.spec.shape)
    made = torch.empty(len(waveforms), *shape)
    for row, waveform in enumerate(waveforms.numpy()):
        windows = [encoder.encode(waveform[:, start : start + WINDOW_SAMPLES]) for start in starts]
        made[row] = torch.from_numpy(np.stack(windows))
    return NetworkInput(made, ArrayLayout(shape, "float32", encoder.spec.low, math.inf))


def readings(stored: StoredDataset, name: str) -> NetworkInput:
    """Return readings of touch in [0, 1]; of long recordings, `TOUCH_FRAMES` moments.

    They stay bytes in memory, and become numbers batch by batch. Unlike those that agents observe,
    0 stays 0: with 9888 taxels at -1, of which a few change, a linear layer learns slowly.
    """
    array = stored.data[name]
    if array.ndim > 2 and array.shape[1] > TOUCH_FRAMES:
        frames = torch.linspace(0, array.shape[1] - 1, TOUCH_FRAMES).round().long()
        chunks = [array[i : i + _CHUNK, frames] for i in range(0, len(array), _CHUNK)]
        array = torch.cat(chunks)
    return NetworkInput(array, ArrayLayout(tuple(array.shape[1:]), "float32", -255.0, 255.0))

"""How the observations of a window become features: shifted, step by step, or through time.

A reader is chosen by whether the network has hidden state.
"""

from __future__ import annotations

from typing import Protocol

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torch.nn import functional
from torchrl.modules import set_recurrent_mode

from veca_marl.algos.sac.replay import VALID, Key, Span, Transitions
from veca_marl.algos.specs import TeamSpec


class FeatureReader(Protocol):
    """Computes the features of the observations before and after the rewards of each target.

    Their shape is ``(targets, agents, F)``.
    """

    def online(self, encoder: TensorDictModuleBase, batch: Transitions) -> tuple[Tensor, Tensor]:
        """Return those before the rewards, with gradient, and those after them, without."""
        ...

    def after(self, encoder: TensorDictModuleBase, batch: Transitions) -> Tensor:
        """Return those after the rewards."""
        ...


class StepReader:
    """Encodes each observation by itself.

    Args:
        team: Name of the team.
    """

    def __init__(self, team: str) -> None:
        self._team = team

    def online(self, encoder: TensorDictModuleBase, batch: Transitions) -> tuple[Tensor, Tensor]:
        """See `FeatureReader`."""
        with torch.no_grad():
            after = self.after(encoder, batch)
        return self._encode(encoder, batch.first), after

    def after(self, encoder: TensorDictModuleBase, batch: Transitions) -> Tensor:
        """See `FeatureReader`."""
        return self._encode(encoder, batch.last)

    def _encode(self, encoder: TensorDictModuleBase, rows: TensorDictBase) -> Tensor:
        features: Tensor = encoder(rows.select(*encoder.in_keys))[self._team, "features"]
        return features


class SequenceReader:
    """Unrolls hidden states through windows.

    The first rows of a window bring the stored state, which older parameters have computed, up to
    date without gradient ("burn-in"). Gradients flow through the steps that are learnt from.

    Source: Kapturowski et al. 2019, "Recurrent experience replay in distributed reinforcement
    learning".

    Args:
        team: Name of the team.
        memory: Keys of the hidden states.
        span: Rows of a window.
    """

    def __init__(self, team: str, memory: tuple[Key, ...], span: Span) -> None:
        self._team, self._memory, self._span = team, memory, span

    def online(self, encoder: TensorDictModuleBase, batch: Transitions) -> tuple[Tensor, Tensor]:
        """See `FeatureReader`."""
        rows = _sequences(batch)
        with torch.no_grad():
            unrolled = self._unroll(encoder, rows)
        learnt = self._burnt_in(rows, unrolled)[:, self._span.learnt]
        before: Tensor = self._unroll(encoder, learnt)[self._team, "features"]
        return before.flatten(0, 1), self._after(rows, unrolled)

    def after(self, encoder: TensorDictModuleBase, batch: Transitions) -> Tensor:
        """See `FeatureReader`."""
        rows = _sequences(batch)
        return self._after(rows, self._unroll(encoder, rows))

    def _unroll(self, encoder: TensorDictModuleBase, rows: TensorDictBase) -> TensorDictBase:
        with set_recurrent_mode(True):
            unrolled: TensorDictBase = encoder(rows.select(*encoder.in_keys))
        return unrolled

    def _burnt_in(self, rows: TensorDictBase, unrolled: TensorDictBase) -> TensorDictBase:
        """Return `rows` with the state after the burn-in, where there are rows for it."""
        row = self._span.burn_in
        if row == 0:
            return rows
        rows = rows.copy()
        for key in self._memory:
            states = rows[key].clone()
            known = rows[VALID][:, row - 1].view(-1, *[1] * (states.ndim - 2))
            states[:, row] = torch.where(known, unrolled["next", *key][:, row - 1], states[:, row])
            rows[key] = states
        return rows

    def _after(self, rows: TensorDictBase, unrolled: TensorDictBase) -> Tensor:
        """Return the features after each target; of a segment that ends sooner, at its end."""
        features = unrolled[self._team, "features"]
        number = torch.arange(features.shape[1], device=features.device)
        end = (number * rows[VALID]).amax(1, keepdim=True)
        at = torch.minimum(number[self._span.following], end)
        windows = torch.arange(len(features), device=features.device).unsqueeze(1)
        after: Tensor = features[windows, at]
        return after.flatten(0, 1)


def _sequences(batch: Transitions) -> TensorDictBase:
    if batch.sequences is None:
        raise ValueError("the batch has no sequences: its replay buffer stores no hidden state")
    return batch.sequences


def make_reader(team: str, memory: tuple[Key, ...], span: Span) -> FeatureReader:
    """Return the reader for a network with these hidden states; none is an empty tuple."""
    return SequenceReader(team, memory, span) if memory else StepReader(team)


def memory_keys(encoder: TensorDictModuleBase, team: str) -> tuple[Key, ...]:
    """Return the keys of the hidden states that `encoder` reads; none if it has none."""
    return tuple(key for key in encoder.in_keys if key[:2] == (team, "memory"))


class RandomShift:
    """Shifts the images of a window of steps by a random number of pixels.

    All pictures of a window, of both eyes and of all its steps and agents, are shifted alike:
    different shifts would change the disparity between the eyes, which shows distance, and the
    motion between two steps.

    Source: Yarats et al. 2021, "Image augmentation is all you need" (DrQ); there every picture
    has a shift of its own.

    Args:
        team: Name of the team.
        spec: Its arrays.
        pixels: Largest shift in each direction; 0 for none.
    """

    def __init__(self, team: str, spec: TeamSpec, pixels: int) -> None:
        self._pixels = pixels
        self._keys = [
            (team, "observation", name)
            for name, layout in spec.observations.items()
            if layout.is_image
        ]

    def __call__(self, *rows: TensorDictBase) -> None:
        """Replace the images in `rows`, each of batch size ``(windows, ...)``."""
        if not self._pixels or not self._keys:
            return
        offsets = torch.randint(2 * self._pixels + 1, (len(rows[0]), 2))
        for part in rows:
            for key in self._keys:
                part[key] = shift(part[key], offsets, self._pixels)


def shift(images: Tensor, offsets: Tensor, pixels: int) -> Tensor:
    """Return `images`, shifted; pixels at the border are repeated.

    TorchRL has no such transform: `RandomCropTensorDict` crops time.

    Args:
        images: ``(windows, ..., height, width)``, at least one dimension between.
        offsets: ``(windows, 2)``, down and right, from 0 to twice `pixels`; `pixels` is no shift.
        pixels: Largest shift.
    """
    *lead, height, width = images.shape
    padded = functional.pad(images.flatten(0, -4), (pixels,) * 4, mode="replicate")
    padded = padded.view(*lead, height + 2 * pixels, width + 2 * pixels)
    moved = [
        padded[window, ..., down : down + height, right : right + width]
        for window, (down, right) in enumerate(offsets.tolist())
    ]
    return torch.stack(moved)

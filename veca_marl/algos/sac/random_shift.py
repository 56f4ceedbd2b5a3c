"""Random shifts of images, the augmentation of pixel-based SAC."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torch.nn import functional

from veca_marl.algos.specs import TeamSpec


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

"""Observations as normalised vectors: what the models of intrinsic rewards read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torch.nn import functional
from torchrl.envs.transforms.rnd import RunningMeanStd

from veca_marl.algos.specs import ArrayLayout, TeamSpec

_CLIP = 5.0  # standard deviations; Burda et al. 2019, section 2.4
_PROPRIOCEPTION = "proprioception"
_BLOCK = 64  # rows that are pooled at a time: their floats fit the cache


def chosen_senses(team: str, spec: TeamSpec, senses: Sequence[str]) -> list[str]:
    """Return the senses that an intrinsic reward reads.

    Args:
        team: Name of the team, for the error message.
        spec: Its arrays.
        senses: Names; none for all senses but proprioception, or for proprioception if the team
            has no other sense. Every movement changes proprioception, so that its novelty
            rewards movements of the body instead of what they cause.

    Raises:
        ValueError: If the team does not have one of them.
    """
    unknown = sorted(set(senses) - set(spec.observations))
    if unknown:
        raise ValueError(
            f"intrinsic.senses: team {team!r} has no {', '.join(unknown)}; "
            f"choices: {', '.join(spec.observations)}"
        )
    others = [name for name in spec.observations if name != _PROPRIOCEPTION]
    return list(senses) or others or list(spec.observations)


class NormalisedSenses(nn.Module):
    """Observations of some senses as vectors, normalised by running mean and deviation.

    Images are averaged over squares of pixels first, to at most `cells` values along each side:
    a model of 84 x 84 pixels would cost as much as the policy itself. Every value is normalised by
    itself and clipped to [-5, 5] standard deviations (Burda et al. 2019, "Exploration by random
    network distillation", section 2.4).

    Args:
        layouts: Sense to layout.
        cells: See above.

    Attributes:
        widths: Sense to the length of its vector.
    """

    def __init__(self, layouts: dict[str, ArrayLayout], cells: int) -> None:
        super().__init__()
        self._windows = {name: _window(layout, cells) for name, layout in layouts.items()}
        self.widths = {
            name: _width(layout, self._windows[name]) for name, layout in layouts.items()
        }
        self.statistics = nn.ModuleDict(
            {name: RunningMeanStd((width,)) for name, width in self.widths.items()}
        )

    def read(self, observations: TensorDictBase) -> Tensor:
        """Return vectors ``(n, D)`` that are not yet normalised.

        Args:
            observations: Sense to array, ``(n,)``.
        """
        parts = [
            _pooled(observations[name], window) if window > 1 else observations[name].flatten(1)
            for name, window in self._windows.items()
        ]
        return torch.cat([part.float() for part in parts], dim=-1)

    def update(self, vectors: Tensor) -> None:
        """Add vectors ``(n, D)`` to the statistics."""
        if not len(vectors):
            return
        for statistics, part in self._parts(vectors):
            statistics.update(part)

    def forward(self, vectors: Tensor) -> Tensor:
        """Normalise and clip vectors ``(n, D)``."""
        parts = [statistics.normalize(part) for statistics, part in self._parts(vectors)]
        return torch.cat(parts, dim=-1).clamp(-_CLIP, _CLIP)

    def _parts(self, vectors: Tensor) -> Iterator[tuple[RunningMeanStd, Tensor]]:
        """Return the statistics and the vectors of each sense."""
        statistics = list(self.statistics.values())
        return zip(statistics, vectors.split(list(self.widths.values()), dim=-1), strict=True)


def _window(layout: ArrayLayout, cells: int) -> int:
    """Return the edge of the squares of pixels that are averaged; 1 for what is not an image."""
    return math.ceil(max(layout.shape[-2:]) / cells) if layout.is_image else 1


def _width(layout: ArrayLayout, window: int) -> int:
    if window == 1:
        return math.prod(layout.shape)
    *stack, height, width = layout.shape
    return math.prod(stack) * math.ceil(height / window) * math.ceil(width / window)


def _pooled(images: Tensor, window: int) -> Tensor:
    """Return means over squares of pixels, ``(n, D)``."""
    parts = [
        functional.avg_pool2d(_stacked(part).float(), window, ceil_mode=True).flatten(1)
        for part in images.split(_BLOCK)
    ]
    return torch.cat(parts)


def _stacked(images: Tensor) -> Tensor:
    """Return ``(n, channels, height, width)``: eyes and colours are channels."""
    channels = math.prod(images.shape[1:-2])
    return images.reshape(len(images), channels, *images.shape[-2:])

"""One encoder per sense, chosen from what its array looks like."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import torch
from torch import Tensor, nn
from torchrl.modules.functional import symlog

from veca_marl.algos.networks.initialisation import orthogonal
from veca_marl.algos.specs import ArrayLayout

_KERNELS = (8, 4, 3)  # Mnih et al. 2015, "Human-level control ...", with a half of their channels
_STRIDES = (4, 2, 1)
# a CPU works 2.4 times as fast on blocks of images that fit its cache: large temporaries are
# handed back to the system and faulted in again, page by page
_CACHED_FLOATS = 32 * 6 * 84 * 84


class Pooling(Enum):
    """What becomes of the last feature maps of an image.

    `flatten` keeps every cell; `places` keeps where in the image each map is lit, which learns
    from far fewer images where a thing is.
    """

    flatten = "flatten"
    places = "places"


class Places(nn.Module):
    """Feature maps ``(N, C, H, W)`` to where what lights them is, and how bright: ``(N, 3 C)``.

    Places are in [-1, 1], right and down. Weights of the mean are a softmax over the map, with a
    sharpness of its own for each map; it begins at 5, of 1, 5 and 20 the one that learnt the place
    of a thing from few images soonest and well.

    Source: Levine et al. 2016, "End-to-end training of deep visuomotor policies" (spatial softmax);
    the brightness beside it is ours: a place alone cannot say that there is nothing.
    """

    def __init__(self, maps: int) -> None:
        super().__init__()
        self.sharpness = nn.Parameter(torch.full((maps, 1), 5.0))

    def forward(self, maps: Tensor) -> Tensor:
        """Return right, down and brightness of each map."""
        height, width = maps.shape[-2:]
        flat = maps.flatten(2)
        weights = (self.sharpness * flat).softmax(-1)
        down, right = torch.meshgrid(_across(height, maps), _across(width, maps), indexing="ij")
        means = [(weights * values).sum(-1) for values in (right.flatten(), down.flatten(), flat)]
        return torch.cat(means, -1)


def _across(cells: int, like: Tensor) -> Tensor:
    return torch.linspace(-1.0, 1.0, cells, dtype=like.dtype, device=like.device)


class ImageEncoder(nn.Module):
    """``uint8 (N, ..., channels, height, width)`` to ``float (N, features)``.

    All leading dimensions (eyes, colours) are stacked as channels. Kernels larger than what is
    left of a small image shrink to it, so that any image size is accepted.

    Args:
        shape: Shape of one observation: at least channels, height, width.
        channels: Output channels of the three convolutions.
        pooling: What becomes of the last maps.

    Attributes:
        features: Length of the output.
    """

    def __init__(
        self,
        shape: Sequence[int],
        channels: Sequence[int] = (16, 32, 32),
        pooling: Pooling = Pooling.flatten,
    ) -> None:
        super().__init__()
        *stack, height, width = shape
        size_in = math.prod(stack)
        layers: list[nn.Module] = []
        for size_out, kernel, stride in zip(channels, _KERNELS, _STRIDES, strict=True):
            window = (min(kernel, height), min(kernel, width))
            layers += [orthogonal(nn.Conv2d(size_in, size_out, window, stride)), nn.ReLU()]
            height, width = (
                (n - k) // stride + 1 for n, k in zip((height, width), window, strict=True)
            )
            size_in = size_out
        places = pooling is Pooling.places
        self.layers = nn.Sequential(*layers, Places(size_in) if places else nn.Flatten())
        self.features = size_in * (3 if places else height * width)

    def forward(self, image: Tensor) -> Tensor:
        """Encode `image`; bytes become floats in [0, 1] here, on the network's device."""
        pixels = image.flatten(1, -3)
        if pixels.is_cuda:
            return self._encode(pixels)
        block = max(1, _CACHED_FLOATS // pixels[0].numel())
        return torch.cat([self._encode(part) for part in pixels.split(block)])

    def _encode(self, pixels: Tensor) -> Tensor:
        features: Tensor = self.layers(pixels.float().mul_(1.0 / 255.0))
        return features


class VectorEncoder(nn.Module):
    """``float (N, ...)`` to ``float (N, features)``: a fixed scale (see `scale_of`), then an MLP.

    Args:
        layout: Layout of one observation.
        features: Length of the output.
        compressed: See `scale_of`.
    """

    def __init__(self, layout: ArrayLayout, features: int = 64, compressed: bool = False) -> None:
        super().__init__()
        self.scale = scale_of(layout, compressed)
        self.layers = nn.Sequential(
            orthogonal(nn.Linear(math.prod(layout.shape), features)),
            nn.ReLU(),
            orthogonal(nn.Linear(features, features)),
            nn.ReLU(),
        )
        self.features = features

    def forward(self, vector: Tensor) -> Tensor:
        """Encode `vector`."""
        features: Tensor = self.layers(self.scale(vector.flatten(1).to(torch.float32)))
        return features


Scale = Callable[[Tensor], Tensor]


def scale_of(layout: ArrayLayout, compressed: bool) -> Scale:
    """Return what brings an array to numbers of about 1.

    Bounds become -1 and 1; an array without bounds passes as it is, or is compressed (symlog,
    Hafner et al. 2023, "Mastering diverse domains through world models"). Nothing is normalised by
    running statistics, which would blur absolute level (loudness is a cue for distance).

    Args:
        layout: Layout of the array.
        compressed: Whether to compress what has no bounds.
    """
    if math.isfinite(layout.low) and math.isfinite(layout.high):
        return Affine((layout.low + layout.high) / 2, 2.0 / (layout.high - layout.low))
    return symlog if compressed else unchanged


@dataclass(frozen=True)
class Affine:
    """What is `centre` becomes 0, and distances from it grow by `factor`."""

    centre: float
    factor: float

    def __call__(self, vector: Tensor) -> Tensor:
        """Scale `vector`."""
        return (vector - self.centre) * self.factor


def unchanged(vector: Tensor) -> Tensor:
    """Return `vector`."""
    return vector


def make_encoder(
    name: str,
    layout: ArrayLayout,
    channels: Sequence[int],
    features: int,
    pooling: Pooling,
    compressed: bool = False,
) -> ImageEncoder | VectorEncoder:
    """Return the encoder that fits `layout`: bytes of rank 3 or more are images, floats vectors.

    Raises:
        ValueError: If nothing fits.
    """
    if layout.dtype == "uint8" and len(layout.shape) >= 3:
        return ImageEncoder(layout.shape, channels, pooling)
    if layout.dtype.startswith("float"):
        return VectorEncoder(layout, features, compressed)
    raise ValueError(
        f"{name}: no encoder for {layout.dtype}{layout.shape}; "
        "choices: uint8 (..., channels, height, width) images, float vectors"
    )

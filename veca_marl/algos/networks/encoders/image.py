"""Encoder of images: three convolutions and a pooling of their maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import torch
from torch import Tensor, nn

from veca_marl.algos.networks.initialisation import orthogonal


@dataclass(frozen=True)
class Convolutions:
    """Three convolutions, each followed by a rectified linear unit.

    Those of Mnih et al. 2015, "Human-level control ...", are ``kernels=(8, 4, 3)`` with twice the
    channels. By default the windows of the first layer do not overlap, as in vision transformers
    (Dosovitskiy et al. 2021): it has a quarter of their products, and those of the others dominate.

    Attributes:
        channels: Output channels of each.
        kernels: Width and height of the window of each, pixels or cells.
        strides: Distance of the windows of each.
    """

    channels: Sequence[int] = (16, 32, 32)
    kernels: Sequence[int] = (4, 4, 3)
    strides: Sequence[int] = (4, 2, 1)


class Pooling(Enum):
    """Pooling of the last feature maps of an image.

    Attributes:
        flatten: Keeps every cell.
        places: Keeps the position of the largest activations of each map, from which the position
            of an object is learnt with far fewer images.
    """

    flatten = "flatten"
    places = "places"


class SpatialSoftmax(nn.Module):
    """Feature maps ``(N, C, H, W)`` to position and strength of their activation, ``(N, 3 C)``.

    Positions are in [-1, 1], to the right and down: means weighted by a softmax over the map, with
    one learnt inverse temperature for each map. Its initial value is 5, which of 1, 5 and 20
    learnt the position of an object from few images with the smallest error.

    Source: Levine et al. 2016, "End-to-end training of deep visuomotor policies" (spatial softmax).
    The strength beside it is ours: a position alone cannot express that nothing is visible.
    """

    def __init__(self, maps: int) -> None:
        super().__init__()
        self.sharpness = nn.Parameter(torch.full((maps, 1), 5.0))

    def forward(self, maps: Tensor) -> Tensor:
        """Return position (right, down) and strength of each map."""
        height, width = maps.shape[-2:]
        flat = maps.flatten(2)
        weights = (self.sharpness * flat).softmax(-1)
        down, right = torch.meshgrid(_across(height, maps), _across(width, maps), indexing="ij")
        means = [(weights * values).sum(-1) for values in (right.flatten(), down.flatten(), flat)]
        return torch.cat(means, -1)


def _across(cells: int, like: Tensor) -> Tensor:
    return torch.linspace(-1.0, 1.0, cells, dtype=like.dtype, device=like.device)


class PixelConv2d(nn.Conv2d):
    """Convolution of bytes as numbers in [0, 1].

    The weights are divided by 255 instead of the pixels, which are many more. In autocast, bytes
    are converted to the type of its arithmetic at once; bfloat16 represents each of them exactly.
    """

    def forward(self, pixels: Tensor) -> Tensor:
        """Return the feature maps ``(N, out, height, width)`` of bytes ``(N, in, H, W)``."""
        device = pixels.device.type
        autocast = torch.is_autocast_enabled(device)
        dtype = torch.get_autocast_dtype(device) if autocast else self.weight.dtype
        maps: Tensor = self._conv_forward(pixels.to(dtype), self.weight / 255.0, self.bias)
        return maps


class ImageEncoder(nn.Module):
    """``uint8 (N, ..., channels, height, width)`` to ``float (N, features)``.

    All leading dimensions (eyes, colours) are stacked as channels. Kernels larger than the
    remaining image shrink to its size, so that any image size is accepted.

    Args:
        shape: Shape of one observation: at least channels, height, width.
        convolutions: Their sizes.
        pooling: Pooling of the last maps.

    Attributes:
        features: Length of the output.
        shape: Shape of one observation.
        strides: Those of the convolutions.
    """

    def __init__(
        self,
        shape: Sequence[int],
        convolutions: Convolutions = Convolutions(),
        pooling: Pooling = Pooling.flatten,
    ) -> None:
        super().__init__()
        *stack, height, width = shape
        size_in = math.prod(stack)
        layers: list[nn.Module] = []
        sizes = convolutions.channels, convolutions.kernels, convolutions.strides
        for size_out, kernel, stride in zip(*sizes, strict=True):
            window = (min(kernel, height), min(kernel, width))
            convolution = nn.Conv2d if layers else PixelConv2d
            layers += [orthogonal(convolution(size_in, size_out, window, stride))]
            layers += [nn.ReLU(inplace=True)]
            height, width = (
                (n - k) // stride + 1 for n, k in zip((height, width), window, strict=True)
            )
            size_in = size_out
        self.shape, self.strides = tuple(shape), tuple(convolutions.strides)
        places = pooling is Pooling.places
        self.layers = nn.Sequential(*layers, SpatialSoftmax(size_in) if places else nn.Flatten())
        self.features = size_in * (3 if places else height * width)

    def forward(self, image: Tensor) -> Tensor:
        """Encode `image`; bytes are converted on the network's device."""
        features: Tensor = self.layers(image.flatten(1, -3))
        return features

"""Encoders: one for each sense, chosen by type and shape of its array; their arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

import torch
from torch import Tensor, nn
from torchrl.modules.functional import symlog

from veca_marl.algos.networks.layers import orthogonal
from veca_marl.algos.specs import ArrayLayout


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
        return nn.functional.conv2d(
            pixels.to(dtype),
            self.weight / 255.0,
            self.bias,
            self.stride,
            self.padding,
            self.dilation,
            self.groups,
        )


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


# oneDNN's convolutions with these instructions are twice as fast as in float32; without them
# bfloat16 is emulated. Other processors have bfloat16 instructions too; they were not measured.
_INSTRUCTIONS = ("avx512_bf16", "amx_bf16")


class Precision(Enum):
    """Arithmetic of an encoder that learns; parameters, heads and losses are float32.

    Copies of a policy that act compute in float32, see `for_acting`.

    Attributes:
        auto: ``bfloat16`` if the processor, and the device where that is another one, have
            instructions for it, else ``float32``. A run stores which of them it is.
        float32: Single precision.
        bfloat16: Inputs and weights of each layer are rounded to 8 significant bits; products are
            summed in single precision.
    """

    auto = "auto"
    float32 = "float32"
    bfloat16 = "bfloat16"

    def on(self, device: torch.device) -> Precision:
        """Return the arithmetic on `device`: ``float32`` or ``bfloat16``."""
        if self is not Precision.auto:
            return self
        return Precision.bfloat16 if has_bfloat16(device) else Precision.float32


def has_bfloat16(device: torch.device) -> bool:
    """Return whether the processor, and `device`, have instructions for bfloat16."""
    capabilities = torch.cpu.get_capabilities()
    if not any(capabilities.get(name, False) for name in _INSTRUCTIONS):
        return False
    return device.type != "cuda" or torch.cuda.is_bf16_supported(including_emulation=False)


class Arithmetic(nn.Module):
    """The arithmetic of an encoder; it has no parameters.

    Args:
        precision: Which it is.
    """

    def __init__(self, precision: Precision) -> None:
        super().__init__()
        self.precision = precision

    def context(self, device: torch.device) -> AbstractContextManager[object]:
        """Return the context in which the encoder computes on `device`: autocast for bfloat16."""
        if self.precision.on(device) is Precision.bfloat16:
            return torch.autocast(device.type, dtype=torch.bfloat16)
        return nullcontext()


M = TypeVar("M", bound=nn.Module)


def for_acting(policy: M) -> M:
    """Let the encoders of `policy` compute in float32, and return it.

    The few observations of a step are encoded as quickly in float32: in bfloat16 all weights are
    rounded at each call, since autocast keeps rounded ones for the backward pass alone.
    """
    for module in policy.modules():
        if isinstance(module, Arithmetic):
            module.precision = Precision.float32
    return policy


class VectorEncoder(nn.Module):
    """``float (N, ...)`` to ``float (N, features)``: a fixed scale (see `scale_of`), then an MLP.

    Args:
        layout: Layout of one observation.
        features: Length of the output.
        compressed: See `scale_of`.

    Attributes:
        features: Length of the output.
        shape: Shape of one observation.
        scale: See `scale_of`.
    """

    def __init__(self, layout: ArrayLayout, features: int = 64, compressed: bool = False) -> None:
        super().__init__()
        self.shape, self.scale = tuple(layout.shape), scale_of(layout, compressed)
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
    """Return the function that scales an array to numbers of about 1.

    Bounds are mapped to -1 and 1; an array without bounds is unchanged, or compressed (symlog,
    Hafner et al. 2023, "Mastering diverse domains through world models"). Nothing is normalised by
    running statistics, which would remove absolute level (loudness is a cue for distance).

    Args:
        layout: Layout of the array.
        compressed: Whether to compress an array without bounds.
    """
    if math.isfinite(layout.low) and math.isfinite(layout.high):
        return Affine((layout.low + layout.high) / 2, 2.0 / (layout.high - layout.low))
    return symlog if compressed else unchanged


@dataclass(frozen=True)
class Affine:
    """Maps `centre` to 0, and multiplies distances from it by `factor`."""

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
    convolutions: Convolutions,
    features: int,
    pooling: Pooling,
    compressed: bool = False,
) -> ImageEncoder | VectorEncoder:
    """Return the encoder for `layout`, an image or a vector of floats.

    Raises:
        ValueError: If there is none.
    """
    if layout.is_image:
        return ImageEncoder(layout.shape, convolutions, pooling)
    if layout.dtype.startswith("float"):
        return VectorEncoder(layout, features, compressed)
    raise ValueError(
        f"{name}: no encoder for {layout.dtype}{layout.shape}; "
        "choices: uint8 (..., channels, height, width) images, float vectors"
    )

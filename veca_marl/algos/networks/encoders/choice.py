"""The encoder of one sense, chosen by type and shape of its array."""

from __future__ import annotations

from veca_marl.algos.networks.encoders.image import Convolutions, ImageEncoder, Pooling
from veca_marl.algos.networks.encoders.vector import VectorEncoder
from veca_marl.algos.specs import ArrayLayout


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

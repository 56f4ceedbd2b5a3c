"""Encoders: one for each sense, chosen by type and shape of its array."""

from veca_marl.algos.networks.encoders.choice import make_encoder
from veca_marl.algos.networks.encoders.image import (
    Convolutions,
    ImageEncoder,
    Pooling,
    SpatialSoftmax,
)
from veca_marl.algos.networks.encoders.vector import VectorEncoder, scale_of

__all__ = [
    "Convolutions",
    "ImageEncoder",
    "SpatialSoftmax",
    "Pooling",
    "VectorEncoder",
    "make_encoder",
    "scale_of",
]

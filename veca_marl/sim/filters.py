"""What dims an eye: filters from images to images that combine in a list."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import cv2
import numpy as np

from veca_marl.sim.optics import Camera
from veca_marl.sim.raster import Depths
from veca_marl.sim.shading import Images


class Look(NamedTuple):
    """What a filter may know beside the images.

    Attributes:
        camera: That took them.
        depth: ``(V, H, W)`` metres along the optical axis.
        focal_distance_m: What the eyes are adjusted to; ``inf`` when relaxed.
    """

    camera: Camera
    depth: Depths
    focal_distance_m: float


class Filter(Protocol):
    """From ``(V, H, W, 3)`` uint8 images to new ones of the same shape."""

    def __call__(self, images: Images, look: Look) -> Images:
        """Return the filtered images; those handed in stay as they are."""
        ...


@dataclass(frozen=True)
class Grey:
    """Luma in all three channels. Weights: Recommendation ITU-R BT.601, as in OpenCV."""

    def __call__(self, images: Images, look: Look) -> Images:
        """Return grey images."""
        out = np.empty_like(images)
        for image, grey in zip(images, out, strict=True):
            cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB, dst=grey)
        return out


@dataclass(frozen=True)
class Blur:
    """Gaussian blur. It passes a grating of f cycles/degree by exp(-2 pi^2 sigma^2 f^2).

    Attributes:
        sigma_deg: Standard deviation in degrees of visual angle.
    """

    sigma_deg: float

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma_deg < math.inf:
            raise ValueError(f"blur of {self.sigma_deg} degrees: want a positive angle")

    def __call__(self, images: Images, look: Look) -> Images:
        """Return blurred images."""
        sigma = self.sigma_deg / look.camera.degrees_per_pixel
        return np.stack([gaussian(image, sigma) for image in images])


def gaussian(image: Images, sigma_pixels: float) -> Images:
    """Blur one ``(H, W, 3)`` image; the edges repeat their last pixel."""
    return cv2.GaussianBlur(image, (0, 0), sigma_pixels, borderType=cv2.BORDER_REPLICATE)


def chosen_filters(
    grey: bool, blur_deg: float, infant_age_months: float | None, defocus: bool
) -> list[Filter]:
    """Return the filters that a configuration asks for, in the order light meets them."""
    if blur_deg < 0.0:
        raise ValueError(f"blur_deg {blur_deg}: want 0 (none) or a positive angle")
    filters: list[Filter] = []
    if blur_deg:
        filters.append(Blur(blur_deg))
    if defocus or infant_age_months is not None:
        raise ValueError("defocus and infant_age_months are not available yet")
    if grey:
        filters.append(Grey())
    return filters

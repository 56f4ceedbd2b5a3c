"""What dims an eye: filters from images to images that combine in a list."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.vision.optics import Camera
from veca_marl.sim.vision.rasterizer import Depths
from veca_marl.sim.vision.shading import Images


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

    Angles count as at the centre of the picture; towards the edges a pixel covers a little less.

    Attributes:
        sigma_deg: Standard deviation in degrees of visual angle.

    Raises:
        ValueError: If the angle is not positive.
    """

    sigma_deg: float

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma_deg < math.inf:
            raise ValueError(f"a blur of {self.sigma_deg} degrees: want a positive angle")

    def __call__(self, images: Images, look: Look) -> Images:
        """Return blurred images."""
        out = np.empty_like(images)
        for image, blurred in zip(images, out, strict=True):
            _gaussian(image, self.sigma_deg / look.camera.degrees_per_pixel, blurred)
        return out


@dataclass(frozen=True)
class Defocus:
    """Blur of what is not at the distance that the eyes are adjusted to.

    A thin lens spreads a point at z metres, seen by an eye adjusted to f metres, over a disc of the
    angular diameter ``pupil * |1 / z - 1 / f|`` radians (Smith, "Angular diameter of defocus blur
    discs", Am. J. Optometry 1982; Strasburger, Bach & Heinrich, "Blur unblurred", i-Perception
    2018). The disc is drawn as the Gaussian of equal variance, ``(diameter / 4)^2``. Each pixel
    gathers its neighbours by its own depth, so a sharp edge in front of a blurred ground leaks a
    little into it.

    Attributes:
        pupil_m: Diameter of the pupil. About 4 mm in indoor light (Watson & Yellott, "A unified
            formula for light-adapted pupil size", J. Vision 2012, fig. 1).

    Raises:
        ValueError: If the pupil is not positive.
    """

    pupil_m: float = 0.004

    def __post_init__(self) -> None:
        if not 0.0 < self.pupil_m < math.inf:
            raise ValueError(f"a pupil of {self.pupil_m} m: want a positive diameter")

    def __call__(self, images: Images, look: Look) -> Images:
        """Return images that are sharp at the focal distance.

        Raises:
            ValueError: If the focal distance is not positive.
        """
        if not look.focal_distance_m > 0.0:
            raise ValueError(f"focal distance {look.focal_distance_m} m: want a positive one")
        out = np.empty_like(images)
        for image, depth, blurred in zip(images, look.depth, out, strict=True):
            variance = self._variance(depth, look)
            levels = _levels(float(variance.max()))
            stack = np.stack([image] * len(levels))
            for level, sigma in enumerate(levels[1:], start=1):
                _gaussian(image, sigma, stack[level])
            _blend(stack, variance, np.square(levels), blurred)
        return out

    def _variance(self, depth: Depths, look: Look) -> Depths:
        """Variance of each pixel's blur in square pixels."""
        radians_per_pixel = math.radians(look.camera.degrees_per_pixel)
        defocus_dioptres = np.abs(1.0 / depth - np.float32(1.0 / look.focal_distance_m))
        sigma = defocus_dioptres * np.float32(self.pupil_m / 4.0 / radians_per_pixel)
        # wider than an eighth of the picture, nothing is left to blur
        widest = np.float32(look.camera.height / 8.0)
        variance: Depths = np.square(np.minimum(sigma, widest))
        return variance


def _levels(largest_variance: float) -> NDArray[np.float64]:
    """Blurs to mix from: 0, then octaves of half a pixel until the largest is covered."""
    octaves = max(0, math.ceil(math.log2(max(math.sqrt(largest_variance), 0.5) / 0.5)))
    return np.concatenate(([0.0], 0.5 * 2.0 ** np.arange(octaves + 1)))


@njit(cache=True)
def _blend(
    stack: NDArray[np.uint8], variance: Depths, levels: NDArray[np.float64], out: Images
) -> None:
    """Mix the two blurred images around each pixel's variance, so that the mixture has it."""
    last = len(levels) - 2
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            level = 0
            while level < last and variance[j, i] > levels[level + 1]:
                level += 1
            share = (variance[j, i] - levels[level]) / (levels[level + 1] - levels[level])
            share = min(share, 1.0)
            for c in range(3):
                low, high = float(stack[level, j, i, c]), float(stack[level + 1, j, i, c])
                out[j, i, c] = np.uint8(low + share * (high - low) + 0.5)


def _gaussian(image: Images, sigma_pixels: float, out: Images) -> None:
    """Blur one ``(H, W, 3)`` image; beyond its edges it goes on with its last pixels."""
    cv2.GaussianBlur(image, (0, 0), sigma_pixels, dst=out, borderType=cv2.BORDER_REPLICATE)

"""Filters of the eyes' images, which can be combined in a list."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.vision.camera import Camera
from veca_marl.sim.vision.rasterizer import Depths
from veca_marl.sim.vision.shading import Images


class FilterContext(NamedTuple):
    """What a filter can use besides the images.

    Attributes:
        camera: The camera of the images.
        depth: ``(V, H, W)`` metres along the optical axis.
        focal_distance_m: Distance to which the eyes are accommodated; ``inf`` when relaxed.
    """

    camera: Camera
    depth: Depths
    focal_distance_m: float


class Filter(Protocol):
    """A function from ``(V, H, W, 3)`` uint8 images to new images of the same shape."""

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return the filtered images; the arguments are not changed."""
        ...


@dataclass(frozen=True)
class Grey:
    """Luma in all three channels, with the weights of ITU-R BT.601 (as in OpenCV)."""

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return grey images."""
        out = np.empty_like(images)
        for image, grey in zip(images, out, strict=True):
            cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB, dst=grey)
        return out


@dataclass(frozen=True)
class Blur:
    """Gaussian blur; its transfer at f cycles per degree is ``exp(-2 pi^2 sigma^2 f^2)``.

    Angles are those at the centre of the image; towards the edges a pixel covers slightly less.

    Attributes:
        sigma_deg: Standard deviation in degrees of visual angle.

    Raises:
        ValueError: If the angle is not positive.
    """

    sigma_deg: float

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma_deg < math.inf:
            raise ValueError(f"sigma_deg {self.sigma_deg} must be a positive angle")

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return blurred images."""
        out = np.empty_like(images)
        for image, blurred in zip(images, out, strict=True):
            _gaussian(image, self.sigma_deg / context.camera.degrees_per_pixel, blurred)
        return out


@dataclass(frozen=True)
class Defocus:
    """Blur of surfaces that are not at the focal distance of the eyes.

    A thin lens focused at f metres spreads a point at z metres over a disc of the angular diameter
    ``pupil * |1 / z - 1 / f|`` radians (Smith, "Angular diameter of defocus blur discs", Am. J.
    Optometry 1982; Strasburger, Bach & Heinrich, "Blur unblurred", i-Perception 2018): 1 mm of
    pupil and 1 dioptre of defocus give 1 milliradian, whatever the resolution. The disc is
    approximated by the Gaussian of equal variance, ``(diameter / 4)^2``. Each pixel gathers its
    neighbours by its own depth, so that a sharp edge in front of a blurred background leaks
    slightly into it.

    Attributes:
        pupil_m: Diameter of the pupil. About 4 mm in indoor light (Watson & Yellott, "A unified
            formula for light-adapted pupil size", J. Vision 2012, fig. 1).
        accommodation_dpt: Fixed accommodation ``1 / f`` in dioptres; None takes the focal distance
            of the context.

    Raises:
        ValueError: If the pupil is not positive, or the accommodation negative or not finite.
    """

    pupil_m: float = 0.004
    accommodation_dpt: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.pupil_m < math.inf:
            raise ValueError(f"pupil_m {self.pupil_m} must be a positive diameter")
        dioptres = self.accommodation_dpt
        if dioptres is not None and not 0.0 <= dioptres < math.inf:
            raise ValueError(f"accommodation_dpt {dioptres} must be finite and not negative")

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return images that are sharp at the focal distance.

        Raises:
            ValueError: If the focal distance is not positive.
        """
        if not context.focal_distance_m > 0.0:
            raise ValueError(f"focal_distance_m {context.focal_distance_m} must be positive")
        out = np.empty_like(images)
        for image, depth, blurred in zip(images, context.depth, out, strict=True):
            variance = self._variance(depth, context)
            levels = _levels(float(variance.max()))
            stack = np.stack([image] * len(levels))
            for level, sigma in enumerate(levels[1:], start=1):
                _gaussian(image, sigma, stack[level])
            _blend(stack, variance, np.square(levels), blurred)
        return out

    def _variance(self, depth: Depths, context: FilterContext) -> Depths:
        """Return the variance of the blur of each pixel in square pixels."""
        radians_per_pixel = math.radians(context.camera.degrees_per_pixel)
        focus_dpt = 1.0 / context.focal_distance_m
        if self.accommodation_dpt is not None:
            focus_dpt = self.accommodation_dpt
        defocus_dpt = np.abs(1.0 / depth - np.float32(focus_dpt))
        sigma = defocus_dpt * np.float32(self.pupil_m / 4.0 / radians_per_pixel)
        # an upper bound of an eighth of the image, where hardly any contrast is left
        widest = np.float32(context.camera.height / 8.0)
        variance: Depths = np.square(np.minimum(sigma, widest))
        return variance


def _levels(largest_variance: float) -> NDArray[np.float64]:
    """Return standard deviations in pixels: 0, then octaves from 0.5 up to the largest blur."""
    octaves = max(0, math.ceil(math.log2(max(math.sqrt(largest_variance), 0.5) / 0.5)))
    return np.concatenate(([0.0], 0.5 * 2.0 ** np.arange(octaves + 1)))


@njit(cache=True)
def _blend(
    stack: NDArray[np.uint8], variance: Depths, levels: NDArray[np.float64], out: Images
) -> None:
    """Interpolate per pixel between the blurred images of the nearest variances."""
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
    """Blur one ``(H, W, 3)`` image; the border pixels are replicated beyond its edges.

    The deviation is at most the larger side: little is left to blur, and OpenCV's windows grow on.
    """
    sigma_pixels = min(sigma_pixels, float(max(image.shape[:2])))
    cv2.GaussianBlur(image, (0, 0), sigma_pixels, dst=out, borderType=cv2.BORDER_REPLICATE)

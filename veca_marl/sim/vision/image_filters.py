"""Filters of the eyes' images, which can be combined in a list: lens, blur, infants, grey.

Sources of the acuity, contrast sensitivity and colour vision of infants by age (`InfantVision`),
and what is our own assumption:

- *Acuity*: mean monocular grating acuity on the Teller Acuity Cards, table 2 of Mayer, Beiser,
  Warner, Pratt, Raye & Lang, "Monocular acuity norms for the Teller Acuity Cards between ages one
  month and four years", Investigative Ophthalmology & Visual Science 36 (1995) 671-685 (read in the
  transcription of the Gilmore lab's visual-acuity repository). Its means at 9 and 12 months, 6.79
  and 6.42 of 30 and 40 infants, are pooled, as acuity does not fall with age. The value at birth,
  0.69, is Brown & Yamamoto's for term newborns (Am. J. Ophthalmology 1986, also acuity cards).
  Between the ages, octaves are interpolated linearly; beyond four years the last value is used.
- *Blur*: that a grating at the acuity limit keeps 10 % of its contrast is our own convention, in
  analogy to resolution criteria for lenses; the limit itself is where infants stop responding.
- *Colour*: the order of events is measured: newborns tell few and only large saturated colours
  from grey, red first (Adams & Courage, Vision Research 1998), three-month-olds are trichromatic,
  with blue-yellow later than red-green (Teller, Vision Research 1998), and thresholds go on
  falling for years (Knoblauch, Vital-Durand & Barbur, Vision Research 2001). Banks & Bennett
  (J. Opt. Soc. Am. A 1988) explain the poor colour vision of newborns by immature cones alone.
  **The gains below are our interpolation of that order, not measurements.**
- *Contrast*: behavioural contrast sensitivity at its peak is about the age in weeks (review of
  Brown & Lindsey, Optometry and Vision Science, June 2009, PMC2765046; most data are of one to four
  months), and the functions of all ages have one shape that moves along both axes (Movshon &
  Kiorpes, J. Opt. Soc. Am. A 1988; both read in their abstracts). The peak of an age counts at all
  frequencies below the acuity limit here, and the rule at all ages, which is **our extrapolation**:
  0.6 % at three years, where a step of the images is 0.4 %. That what is left of a faint contrast
  is the probability of seeing it is ours too.

Field of view and eye alignment are an adult's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.kernels import kernel
from veca_marl.sim.vision.camera import Camera
from veca_marl.sim.vision.rasterizer import Depths
from veca_marl.sim.vision.shading import Images

_ACUITY_AGES_MONTHS = (0.0, 1.0, 1.5, 2.5, 4.0, 6.0, 9.0, 12.0, 18.0, 24.0, 30.0, 36.0, 48.0)
_ACUITY_CPD = (0.69, 0.94, 1.11, 2.16, 2.68, 5.65, 6.58, 6.58, 8.59, 9.57, 11.52, 21.81, 24.81)

_GAIN_AGES_MONTHS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 12.0, 24.0)
_RED_GREEN_GAINS = (0.10, 0.25, 0.45, 0.60, 0.70, 0.80, 0.90, 1.00)
_BLUE_YELLOW_GAINS = (0.00, 0.05, 0.15, 0.35, 0.50, 0.70, 0.85, 1.00)

CONTRAST_AT_LIMIT = 0.1

# BT.601: luma, and the two colour differences (red - luma, blue - luma)
_LUMA = np.array([0.299, 0.587, 0.114])


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


@kernel
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


def acuity_cpd(age_months: float) -> float:
    """Return the highest spatial frequency that an infant resolves, in cycles per degree."""
    octaves = np.interp(age_months, _ACUITY_AGES_MONTHS, np.log2(_ACUITY_CPD))
    return float(2.0**octaves)


def acuity_blur_deg(limit_cpd: float) -> float:
    """Return the Gaussian blur that reduces a grating at the limit to `CONTRAST_AT_LIMIT`.

    Solves ``exp(-2 pi^2 sigma^2 f^2) = CONTRAST_AT_LIMIT`` for sigma, in degrees.
    """
    return math.sqrt(-math.log(CONTRAST_AT_LIMIT) / 2.0) / (math.pi * limit_cpd)


def colour_gains(age_months: float) -> tuple[float, float]:
    """Return the red-green and the blue-yellow contrast relative to an adult's, in [0, 1]."""
    return (
        float(np.interp(age_months, _GAIN_AGES_MONTHS, _RED_GREEN_GAINS)),
        float(np.interp(age_months, _GAIN_AGES_MONTHS, _BLUE_YELLOW_GAINS)),
    )


def colour_matrix(red_green: float, blue_yellow: float) -> NDArray[np.float64]:
    """Return the ``(3, 3)`` matrix that scales colour differences and keeps luma (BT.601)."""
    red = red_green * np.eye(3)[0] + (1.0 - red_green) * _LUMA
    blue = blue_yellow * np.eye(3)[2] + (1.0 - blue_yellow) * _LUMA
    green = (_LUMA - _LUMA[0] * red - _LUMA[2] * blue) / _LUMA[1]
    return np.stack([red, green, blue])


_WEEKS_PER_MONTH = 365.25 / 12.0 / 7.0
_YOUNGEST_WEEKS = 4.0  # of the data; younger ones have the contrast threshold of this age


def contrast_threshold(age_months: float) -> float:
    """Return the least contrast that an infant sees, relative to the local mean, in (0, 1]."""
    return 1.0 / max(age_months * _WEEKS_PER_MONTH, _YOUNGEST_WEEKS)


_COARSEST_PIXELS = 4
_AROUND_PIXELS = 2.0
_SHARE = 0.5  # of the amplitude of a grating that is in the band of its frequency, but the finest
_STEEPNESS = 3.5


@dataclass(frozen=True)
class ContrastThreshold:
    """Takes away what has a contrast below a threshold, at every scale.

    An image is divided into octave bands of spatial frequency (a Laplacian pyramid, Burt & Adelson,
    IEEE Transactions on Communications 1983, by means of areas, so that a mirror image gives the
    mirror image). The contrast c of a band is its value relative to the mean of the surroundings,
    all coarser bands (Peli, "Contrast in complex images", J. Opt. Soc. Am. A 1990): the amplitude
    of a grating that has the mean square of the three colours and of a few pixels around. With the
    threshold T, the fraction ``1 - exp(-(c / T)^3.5)`` of the band is left, the probability of
    seeing it (Robson & Graham, Vision Research 1981).

    Attributes:
        threshold: T, in (0, 1].
    """

    threshold: float

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return images without faint contrast."""
        out = np.empty_like(images)
        for image, filtered in zip(images, out, strict=True):
            filtered[:] = np.clip(np.rint(self._filtered(image.astype(np.float32))), 0.0, 255.0)
        return out

    def _filtered(self, image: Depths) -> Depths:
        """Return one ``(H, W, 3)`` image of numbers from 0 to 255."""
        height, width = image.shape[:2]
        if min(height, width) < 2 * _COARSEST_PIXELS:
            return image
        half = (width + 1) // 2, (height + 1) // 2
        coarse = cv2.resize(image, half, interpolation=cv2.INTER_AREA)
        mean = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
        band = image - mean
        power = cv2.GaussianBlur(np.square(band).mean(axis=2), (0, 0), _AROUND_PIXELS)
        contrast = np.sqrt(2.0 * power) / (_SHARE * np.maximum(mean.mean(axis=2), 1.0))
        seen = -np.expm1(-((contrast / self.threshold) ** _STEEPNESS))
        coarse = self._filtered(np.asarray(coarse, np.float32))
        around = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
        filtered: Depths = around + seen[..., None] * band
        return filtered


@dataclass(frozen=True)
class InfantVision:
    """The filter of an infant: `acuity_cpd` as blur, `contrast_threshold`, and `colour_gains`.

    Images of 84 pixels for 60 degrees are limited to 0.7 cycles per degree, near the acuity of a
    newborn: the blur is small at one month and invisible from three months on. Acuity has an
    effect only with more pixels per degree; contrast and colour have one in any case.

    Attributes:
        age_months: Age since birth at term.

    Raises:
        ValueError: If the age is negative.
    """

    age_months: float
    _blur: Blur = field(init=False, repr=False)
    _contrast: ContrastThreshold = field(init=False, repr=False)
    _colours: NDArray[np.float64] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.age_months < math.inf:
            raise ValueError(f"age_months {self.age_months} must be finite and not negative")
        object.__setattr__(self, "_blur", Blur(acuity_blur_deg(acuity_cpd(self.age_months))))
        threshold = contrast_threshold(self.age_months)
        object.__setattr__(self, "_contrast", ContrastThreshold(threshold))
        object.__setattr__(self, "_colours", colour_matrix(*colour_gains(self.age_months)))

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return blurred images of reduced contrast and saturation."""
        # of what is there: after the blur, the finest detail that is resolved would be too faint
        out = self._blur(self._contrast(images, context), context)
        for image in out:
            cv2.transform(image, self._colours, dst=image)
        return out

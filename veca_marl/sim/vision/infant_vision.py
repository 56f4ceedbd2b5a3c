"""Visual acuity and colour vision of infants by age.

Sources, and what is our own assumption:

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

Contrast sensitivity below the acuity limit, field of view and eye alignment are an adult's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.vision.image_filters import Blur, FilterContext
from veca_marl.sim.vision.shading import Images

_ACUITY_AGES_MONTHS = (0.0, 1.0, 1.5, 2.5, 4.0, 6.0, 9.0, 12.0, 18.0, 24.0, 30.0, 36.0, 48.0)
_ACUITY_CPD = (0.69, 0.94, 1.11, 2.16, 2.68, 5.65, 6.58, 6.58, 8.59, 9.57, 11.52, 21.81, 24.81)

_GAIN_AGES_MONTHS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 12.0, 24.0)
_RED_GREEN_GAINS = (0.10, 0.25, 0.45, 0.60, 0.70, 0.80, 0.90, 1.00)
_BLUE_YELLOW_GAINS = (0.00, 0.05, 0.15, 0.35, 0.50, 0.70, 0.85, 1.00)

CONTRAST_AT_LIMIT = 0.1

# BT.601: luma, and the two colour differences (red - luma, blue - luma)
_LUMA = np.array([0.299, 0.587, 0.114])


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


@dataclass(frozen=True)
class InfantVision:
    """The filter of an infant of a given age: `acuity_cpd` as blur, `colour_gains` as saturation.

    Images of 84 pixels for 60 degrees are limited to 0.7 cycles per degree, near the acuity of a
    newborn: the blur is small at one month and invisible from three months on. Acuity has an
    effect only with more pixels per degree; colour has one in any case.

    Attributes:
        age_months: Age since birth at term.

    Raises:
        ValueError: If the age is negative.
    """

    age_months: float
    _blur: Blur = field(init=False, repr=False)
    _colours: NDArray[np.float64] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.age_months < math.inf:
            raise ValueError(f"age_months {self.age_months} must be finite and not negative")
        object.__setattr__(self, "_blur", Blur(acuity_blur_deg(acuity_cpd(self.age_months))))
        object.__setattr__(self, "_colours", colour_matrix(*colour_gains(self.age_months)))

    def __call__(self, images: Images, context: FilterContext) -> Images:
        """Return blurred images of reduced saturation."""
        out = self._blur(images, context)
        for image in out:
            cv2.transform(image, self._colours, dst=image)
        return out

"""How the size of a body depends on its age, from 1 to 36 months: factors of the table of bones.

The table of bones is a body of 0.78 m and 10 kg. A body of another age or height has the same bones
and joints, with other lengths, girths, masses and torques. `Growth` holds the factors.

Sources, and what is our own:

- *Height, mass, head circumference*: medians of the WHO Child Growth Standards (WHO Multicentre
  Growth Reference Study Group, "WHO Child Growth Standards", Geneva 2006 and 2007): length or
  height for age, weight for age, head circumference for age, at each month, mean of boys and girls;
  read in the tables of the WHO's package `anthro`. Length is measured lying below 24 months and
  height standing from then on, which is 7 mm less. Between months values are interpolated linearly.
- *Limbs, hands, feet, hips*: means of infants in Snyder, Schneider, Owings, Reynolds, Golomb &
  Schork, "Anthropometry of infants, children, and youths to age 18 for product safety design",
  UM-HSRI-77-17, 1977, by groups of 0-2, 3-5, 6-8, 9-11, 12-15, 16-19 and 20-23 completed months, as
  they are quoted in the growth module of MIMo (Mattern et al. 2024, IEEE Transactions on Cognitive
  and Developmental Systems; its version 2 grows from 0 to 24 months by the same report). Each is
  divided by the WHO's height at the middle of the group (1.5 months for the first, at which heads
  of that report are nearest to the WHO's; MIMo takes 1), and a straight line over the logarithm of
  the age is fitted to the ratio. **Beyond 22 months these lines are extrapolated.**
- *Trunk and neck*: their length is what remains of the height; their girth follows the breadth of
  the hips.
- *Head*: all its lengths follow its circumference, with eyes, ears and mouth. That the distance of
  the eyes does so is our assumption.
- *Masses*: each segment's volume (length times girth squared) times the density that the table of
  bones gives it; one common factor makes the sum the WHO's mass, because densities of segments of
  infants are not published for each age.
- *Torques*: proportional to the volume of the bone that a joint moves, as in MIMo: a muscle's
  torque is its cross-section times its lever. **Strength of infants has not been measured joint by
  joint.**
- *Walking speed*: proportional to the root of the length of the legs, at which the Froude number is
  equal (Alexander 1989, Physiological Reviews 69). **A size says nothing about whether a child of
  that age walks**; a walker of 4 months walks as if it could.
- *Voice*: the pitch is inversely proportional to the length of the vocal folds (Titze 1989,
  J. Acoust. Soc. Am. 85); that these are in proportion to the height is our assumption.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

YOUNGEST_MONTHS, OLDEST_MONTHS = 1.0, 36.0

# medians at 1, 2, ... 36 months, mean of boys and girls
WHO_HEIGHT_CM = (
    *(54.15, 57.76, 60.59, 63.01, 64.96, 66.70, 68.22, 69.70, 71.06, 72.37, 73.66, 74.87),
    *(76.08, 77.21, 78.34, 79.41, 80.44, 81.49, 82.47, 83.46, 84.39, 85.34, 86.23, 87.10),
    *(87.28, 88.12, 88.96, 89.75, 90.55, 91.30, 92.06, 92.78, 93.49, 94.20, 94.88, 95.57),
)
WHO_MASS_KG = (
    *(4.31, 5.35, 6.10, 6.72, 7.20, 7.62, 7.97, 8.29, 8.56, 8.82, 9.07, 9.30),
    *(9.52, 9.74, 9.96, 10.17, 10.37, 10.59, 10.79, 11.00, 11.20, 11.41, 11.61, 11.81),
    *(12.02, 12.22, 12.42, 12.62, 12.81, 13.00, 13.19, 13.37, 13.55, 13.74, 13.92, 14.10),
)
WHO_HEAD_CM = (
    *(36.88, 38.70, 40.01, 41.11, 42.00, 42.77, 43.40, 43.96, 44.42, 44.81, 45.17, 45.48),
    *(45.76, 46.00, 46.23, 46.44, 46.63, 46.81, 46.97, 47.14, 47.29, 47.44, 47.58, 47.71),
    *(47.85, 47.97, 48.10, 48.21, 48.33, 48.43, 48.54, 48.63, 48.73, 48.82, 48.90, 48.99),
)
_MONTHS = tuple(float(month) for month in range(1, 37))

SNYDER_MONTHS = (1.5, 4.5, 7.5, 10.5, 14.0, 18.0, 22.0)
SNYDER_CM = {
    "shoulder_elbow": (10.9, 12.3, 13.1, 14.5, 14.9, 15.4, 16.2),
    "upper_arm_circumference": (11.8, 13.0, 14.0, 14.8, 14.5, 14.7, 15.0),
    "elbow_hand": (14.9, 16.6, 18.0, 19.6, 19.9, 20.7, 21.5),
    "forearm_circumference": (11.8, 13.1, 14.0, 14.3, 14.5, 14.5, 14.8),
    "hand_length": (6.8, 7.4, 8.0, 8.9, 9.2, 9.3, 9.5),
    "hand_breadth": (3.7, 4.1, 4.2, 4.5, 4.6, 4.6, 4.7),
    "hip_breadth": (13.2, 14.3, 15.9, 16.6, 16.9, 17.1, 17.1),
    "rump_knee": (13.9, 15.9, 17.2, 19.2, 19.9, 21.3, 22.6),
    "mid_thigh_circumference": (16.9, 20.7, 21.2, 23.2, 23.4, 24.4, 24.7),
    "knee_sole": (14.9, 16.5, 17.9, 19.8, 20.8, 21.6, 23.0),
    "calf_circumference": (13.7, 15.6, 16.9, 18.1, 18.1, 18.4, 19.0),
    "foot_length": (8.2, 9.1, 10.0, 10.9, 11.7, 11.9, 12.5),
    "foot_breadth": (3.6, 4.0, 4.2, 4.7, 4.9, 5.0, 5.2),
}

# lengths of the table of bones, metres: with their sum it stands 0.78 m high
_HEAD_M, _TRUNK_M, _THIGH_M, _SHANK_M, _SOLE_M = 0.135, 0.313, 0.155, 0.135, 0.0432
_HALF_HEAD_M = 0.066  # from the top of the neck to the middle between the ears
REFERENCE_HEIGHT_M = _HEAD_M + _TRUNK_M + _THIGH_M + _SHANK_M + _SOLE_M


class Scale(NamedTuple):
    """Factors of the lengths of a bone.

    Attributes:
        x: Along x of its frame.
        y: Along y.
        z: Along z.
        girth: Of radii and of the thickness of the skin.
    """

    x: float = 1.0
    y: float = 1.0
    z: float = 1.0
    girth: float = 1.0

    @property
    def volume(self) -> float:
        """Factor of the volume."""
        return self.x * self.y * self.z

    @property
    def vector(self) -> tuple[float, float, float]:
        """The factors along x, y and z."""
        return self.x, self.y, self.z


_SAME = Scale()


@dataclass(frozen=True)
class Growth:
    """The size of a body: factors relative to the table of bones. The default is that table.

    Attributes:
        height_m: Standing height.
        mass_kg: Mass of the whole body; None for that of the table of bones.
        head: Factors of the head, with eyes, ears and mouth.
        trunk: Of pelvis, spine, chest and neck.
        upper_arm: Of the upper arms.
        forearm: Of the forearms.
        hand: Of hands and fingers.
        thigh: Of the thighs.
        shank: Of the shanks.
        foot: Of the feet; x is their length.
    """

    height_m: float = REFERENCE_HEIGHT_M
    mass_kg: float | None = None
    head: Scale = _SAME
    trunk: Scale = _SAME
    upper_arm: Scale = _SAME
    forearm: Scale = _SAME
    hand: Scale = _SAME
    thigh: Scale = _SAME
    shank: Scale = _SAME
    foot: Scale = _SAME

    def of(self, bone: str) -> Scale:
        """Return the factors of a bone by name, such as `l_forearm`."""
        part = bone.removeprefix("l_").removeprefix("r_")
        scale: Scale = getattr(self, _GROUPS.get(part, "hand"))  # fingers are of the hand
        return scale

    @property
    def head_size(self) -> float:
        """Factor of all lengths of the head."""
        return self.head.girth

    @property
    def size(self) -> float:
        """Factor of the standing height."""
        return self.height_m / REFERENCE_HEIGHT_M

    @property
    def leg(self) -> float:
        """Factor of the length of the legs."""
        return (_THIGH_M * self.thigh.z + _SHANK_M * self.shank.z) / (_THIGH_M + _SHANK_M)

    @property
    def sitting(self) -> float:
        """Factor of the height of the middle of the head above the hips."""
        whole_m = _TRUNK_M * self.trunk.z + _HALF_HEAD_M * self.head.z
        return whole_m / (_TRUNK_M + _HALF_HEAD_M)

    @property
    def speed(self) -> float:
        """Factor of walking speeds: at the same Froude number."""
        return math.sqrt(self.leg)

    @property
    def pitch(self) -> float:
        """Factor of the frequencies of the voice."""
        return 1.0 / self.size


_GROUPS = {
    **{name: name for name in ("head", "upper_arm", "forearm", "thigh", "shank", "foot")},
    **dict.fromkeys(("pelvis", "spine", "chest", "neck"), "trunk"),
}
REFERENCE = Growth()


@functools.cache
def growth_at(age_months: float) -> Growth:
    """Return the size of a body at an age, from 1 to 36 months.

    Raises:
        ValueError: If the age is outside this range.
    """
    if not YOUNGEST_MONTHS <= age_months <= OLDEST_MONTHS:
        raise ValueError(
            f"body.age_months={age_months} must be from {YOUNGEST_MONTHS:g} to {OLDEST_MONTHS:g}, "
            "the ages of the growth tables; without it the body is that of 0.78 m"
        )
    at = functools.partial(_factor, age_months)
    head = float(np.interp(age_months, _MONTHS, WHO_HEAD_CM)) / _reference(WHO_HEAD_CM)
    height_m = float(np.interp(age_months, _MONTHS, WHO_HEIGHT_CM)) / 100.0
    thigh, shank = at("rump_knee"), at("knee_sole")
    legs_m = _THIGH_M * thigh + (_SHANK_M + _SOLE_M) * shank
    trunk = (height_m - _HEAD_M * head - legs_m) / _TRUNK_M
    forearm = _forearm_cm(age_months) / _forearm_cm(_reference_months())
    return Growth(
        height_m=height_m,
        mass_kg=float(np.interp(age_months, _MONTHS, WHO_MASS_KG)),
        head=_along_z(head, head),
        trunk=_along_z(trunk, at("hip_breadth")),
        upper_arm=_along_z(at("shoulder_elbow"), at("upper_arm_circumference")),
        forearm=_along_z(forearm, at("forearm_circumference")),
        hand=_along_z(at("hand_length"), at("hand_breadth")),
        thigh=_along_z(thigh, at("mid_thigh_circumference")),
        shank=_along_z(shank, at("calf_circumference")),
        foot=Scale(at("foot_length"), at("foot_breadth"), shank, shank),
    )


def growth_of_height(height_m: float) -> Growth:
    """Return the size of a body of a standing height, with the proportions of its age.

    That age is the one at which this height is the median, from 1 to 36 months.

    Raises:
        ValueError: If no age has this height.
    """
    if not WHO_HEIGHT_CM[0] <= 100.0 * height_m <= WHO_HEIGHT_CM[-1]:
        raise ValueError(
            f"body.height_m={height_m} must be from {WHO_HEIGHT_CM[0] / 100.0:g} to "
            f"{WHO_HEIGHT_CM[-1] / 100.0:g}, the heights from {YOUNGEST_MONTHS:g} to "
            f"{OLDEST_MONTHS:g} months; without it the body is that of 0.78 m"
        )
    return growth_at(_months_of_cm(100.0 * height_m))


def _along_z(length: float, girth: float) -> Scale:
    return Scale(girth, girth, length, girth)


def _months_of_cm(height_cm: float) -> float:
    """Return the age at which a height is the median; heights increase with the age."""
    return float(np.interp(height_cm, WHO_HEIGHT_CM, _MONTHS))


def _reference_months() -> float:
    """Return the age at which the body of the table of bones has the median height."""
    return _months_of_cm(100.0 * REFERENCE_HEIGHT_M)


def _reference(table: tuple[float, ...]) -> float:
    return float(np.interp(_reference_months(), _MONTHS, table))


def _factor(age_months: float, measure: str) -> float:
    """Return a measure at an age relative to that of the table of bones."""
    return measure_cm(measure, age_months) / measure_cm(measure, _reference_months())


def _forearm_cm(age_months: float) -> float:
    return measure_cm("elbow_hand", age_months) - measure_cm("hand_length", age_months)


def measure_cm(measure: str, age_months: float) -> float:
    """Return one of `SNYDER_CM` at an age: the WHO's height times the fitted proportion."""
    offset, slope = _proportion(measure)
    height_cm = float(np.interp(age_months, _MONTHS, WHO_HEIGHT_CM))
    return height_cm * (offset + slope * math.log(age_months))


@functools.cache
def _proportion(measure: str) -> tuple[float, float]:
    """Return offset and slope, per logarithm of the months, of a measure relative to the height."""
    heights_cm = np.interp(SNYDER_MONTHS, _MONTHS, WHO_HEIGHT_CM)
    shares = np.array(SNYDER_CM[measure]) / heights_cm
    slope, offset = np.polyfit(np.log(SNYDER_MONTHS), shares, 1)
    return float(offset), float(slope)

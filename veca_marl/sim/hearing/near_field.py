"""Level of a near source at the ears of a rigid sphere, relative to that of a distant one."""

from __future__ import annotations

import math

from numba import njit

NEAREST_RADII = 1.25
"""Distance of a source from the centre of the head, in radii of the head, below which its level is
constant; that of the nearest source that Duda & Martens (1998) consider."""


@njit(cache=True)
def sphere_gain(radius_over_distance: float, cosine: float) -> float:
    """Return the pressure at low frequency on a rigid sphere, relative to the free field's.

    The limit of Duda & Martens (1998), eq. 3, at 0 Hz is the series over m of
    ``(2 m + 1) / (m + 1) x^m P_m(cosine)`` with x the radius over the distance; this is its sum.

    Args:
        radius_over_distance: Radius of the sphere over the distance of the point source from its
            centre, in (0, 1).
        cosine: Of the angle between the ear and the source, seen from the centre, in [-1, 1].

    Returns:
        Pressure at the ear over that at the centre of the absent sphere; 1 for a distant source.
    """
    x = radius_over_distance
    root = math.sqrt(1.0 - 2.0 * x * cosine + x * x)
    # equal expressions; each is exact where the other divides by zero
    if cosine > 0.0:
        ratio = (1.0 + cosine) / (root - x + cosine)
    else:
        ratio = (x - cosine + root) / (1.0 - cosine)
    return 2.0 / root - math.log(ratio) / x


@njit(cache=True)
def near_field_gain(radius_m: float, distance_m: float, reference_m: float, cosine: float) -> float:
    """Return the factor of the level at an ear for a source that is not as far as the measured one.

    It multiplies the response that was measured at `reference_m` and 1/d. The distance variation
    function of a sphere (Kan, Jin & van Schaik 2009) is nearly independent of frequency on the side
    of the source and stronger at high frequency on the other side; its value at low frequency is
    used for all.

    Args:
        radius_m: Radius of the head.
        distance_m: Distance of the source from the centre of the head, at least `NEAREST_RADII`
            times the radius.
        reference_m: Distance of the loudspeaker of the measurement, likewise.
        cosine: Of the angle between the ear and the source, in [-1, 1].
    """
    near = sphere_gain(radius_m / distance_m, cosine)
    return near / sphere_gain(radius_m / reference_m, cosine)

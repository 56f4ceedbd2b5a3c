"""Modes of vibration of simple shapes: frequencies, decay rates and amplitudes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.impacts.materials import MaterialProperties
from veca_marl.sim.sound.rooms import SPEED_OF_SOUND_MPS

BAR_ROOTS = (4.7300, 7.8532, 10.9956, 14.1372)
"""Roots of ``cos(x) cosh(x) = 1`` (free-free bar, Fletcher & Rossing 1998, section 2.15)."""

SPHERE_ROOTS = (2.646, 3.937, 5.046)
"""``2 pi f a / c_s`` of the spheroidal modes with 2, 3 and 4 nodal lines of a solid sphere with
Poisson's ratio 0.3: first roots of the frequency equation (Lamb 1882; Eringen & Suhubi 1975,
section 8.14)."""


@dataclass(frozen=True)
class Modes:
    """Modes of a struck body.

    Attributes:
        frequencies_hz: ``(M,)``.
        decay_per_s: ``(M,)`` rates at which the amplitudes decay.
        amplitudes: ``(M,)`` relative to each other.
    """

    frequencies_hz: Floats
    decay_per_s: Floats
    amplitudes: Floats

    def __add__(self, other: Modes) -> Modes:
        """Return the modes of both."""
        return Modes(
            np.concatenate([self.frequencies_hz, other.frequencies_hz]),
            np.concatenate([self.decay_per_s, other.decay_per_s]),
            np.concatenate([self.amplitudes, other.amplitudes]),
        )

    def below(self, limit_hz: float) -> Modes:
        """Return the modes with frequencies below a limit."""
        kept = self.frequencies_hz < limit_hz
        return Modes(self.frequencies_hz[kept], self.decay_per_s[kept], self.amplitudes[kept])


def bar_modes(length_m: float, gyration_m: float, material: MaterialProperties) -> Modes:
    """Return the flexural modes of a free slender bar (Fletcher & Rossing 1998, eq. 2.62).

    Args:
        length_m: Its length.
        gyration_m: Radius of gyration of its cross-section in the plane of bending: thickness
            divided by ``sqrt(12)`` for a rectangle, half of the radius for a circle.
        material: What it is made of.
    """
    roots = np.array(BAR_ROOTS)
    frequencies = roots**2 * gyration_m * material.bar_speed_mps / (2.0 * np.pi * length_m**2)
    return _modes(frequencies, material)


def sphere_modes(radius_m: float, material: MaterialProperties) -> Modes:
    """Return the spheroidal modes of a solid sphere, see `SPHERE_ROOTS`."""
    frequencies = np.array(SPHERE_ROOTS) * material.shear_speed_mps / (2.0 * np.pi * radius_m)
    return _modes(frequencies, material)


def acceleration_noise(radius_m: float, contact_s: float) -> Modes:
    """Return the sound of a rigid sphere that is stopped, without vibration: a short click.

    Its pressure is a damped oscillation with frequency ``c / (2 pi a)`` and decay rate ``c / a``
    in air (Koss & Alfredson 1973, Transient sound radiated by spheres undergoing an elastic
    collision). It is what is heard of compact things that ring above the audible range.
    """
    rate = SPEED_OF_SOUND_MPS / radius_m
    frequency = np.array([rate / (2.0 * np.pi)])
    return Modes(frequency, np.array([rate]), _excitation(frequency, contact_s))


def _modes(frequencies_hz: Floats, material: MaterialProperties) -> Modes:
    decay = np.pi * frequencies_hz * material.loss_tangent
    return Modes(frequencies_hz, decay, _excitation(frequencies_hz, material.contact_s))


def _excitation(frequencies_hz: Floats, contact_s: float) -> Floats:
    """Return the spectrum of a force in the form of half a sine, relative to its impulse."""
    x = 2.0 * frequencies_hz * contact_s
    near = np.abs(x - 1.0) < 1e-6
    safe = np.where(near, 0.0, x)
    spectrum: Floats = np.abs(np.cos(0.5 * np.pi * safe) / (1.0 - safe**2))
    return np.where(near, math.pi / 4.0, spectrum)

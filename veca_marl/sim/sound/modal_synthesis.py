"""Modal synthesis: the sounds of things that hit each other.

Materials, the modes of vibration of simple shapes, and bodies that sound when they are struck.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.sound.waveforms import Samples

BAR_ROOTS = (4.7300, 7.8532, 10.9956, 14.1372)
"""Roots of ``cos(x) cosh(x) = 1`` (free-free bar, Fletcher & Rossing 1998, section 2.15)."""

SPHERE_ROOTS = (2.646, 3.937, 5.046)
"""``2 pi f a / c_s`` of the spheroidal modes with 2, 3 and 4 nodal lines of a solid sphere with
Poisson's ratio 0.3: first roots of the frequency equation (Lamb 1882; Eringen & Suhubi 1975,
section 8.14)."""

_INAUDIBLE = 1e-6  # pressure, -120 dB: the decay ends here
_TOP_OF_BAND = 0.9


class Material(Enum):
    """What a thing is made of."""

    rubber = "rubber"
    plastic = "plastic"
    wood = "wood"
    glass = "glass"
    metal = "metal"


@dataclass(frozen=True)
class MaterialProperties:
    """Properties that determine pitch and decay.

    Attributes:
        density_kgpm3: Mass per volume.
        youngs_modulus_pa: Stiffness.
        poisson: Poisson's ratio.
        loss_tangent: Tangent of the angle of internal friction: amplitudes decay at the rate
            ``pi f loss_tangent`` (van den Doel & Pai 1998, The sounds of physical shapes, eq. 9).
        contact_s: Duration of an impact on a hard surface; it limits the frequencies excited.
    """

    density_kgpm3: float
    youngs_modulus_pa: float
    poisson: float
    loss_tangent: float
    contact_s: float

    @property
    def bar_speed_mps(self) -> float:
        """Speed of longitudinal waves in a bar."""
        return math.sqrt(self.youngs_modulus_pa / self.density_kgpm3)

    @property
    def shear_speed_mps(self) -> float:
        """Speed of shear waves."""
        return self.bar_speed_mps / math.sqrt(2.0 * (1.0 + self.poisson))


MATERIALS = {
    Material.rubber: MaterialProperties(1100.0, 2e7, 0.48, 0.1, 4e-3),
    Material.plastic: MaterialProperties(1050.0, 2.5e9, 0.38, 0.02, 0.8e-3),
    Material.wood: MaterialProperties(600.0, 1e10, 0.35, 0.012, 0.5e-3),
    Material.glass: MaterialProperties(2500.0, 7e10, 0.22, 0.002, 0.2e-3),
    Material.metal: MaterialProperties(7850.0, 2e11, 0.29, 0.001, 0.15e-3),
}
"""Typical values of the charts of Ashby (2011), Materials Selection in Mechanical Design; loss
tangents at the upper end, because things that lie or are held lose energy at their supports. The
durations of contact are ours, in the order of Hertz's theory for things of 0.1 m at 1 m/s."""


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


class StruckBody:
    """A `Sound` that is silent until `strike` excites the modes of a body.

    The pressure at 1 m after an impulse J is ``gain J sum_m a_m exp(-d_m t) sin(2 pi f_m t)``
    (van den Doel & Pai 1998, eq. 8): its energy grows with the square of the impulse.
    """

    def __init__(self, modes: Modes, gain_per_ns: float, sample_rate_hz: float) -> None:
        """Prepare the oscillations.

        Args:
            modes: Modes of the body; those above 0.9 of the Nyquist frequency are left out.
            gain_per_ns: Pressure at 1 m per newton second, for a mode of amplitude 1.
            sample_rate_hz: Sampling rate of the sound field.
        """
        audible = modes.below(_TOP_OF_BAND * sample_rate_hz / 2.0)
        rates = -audible.decay_per_s + 2j * np.pi * audible.frequencies_hz
        self._step_per_sample = rates / sample_rate_hz
        amplitudes = gain_per_ns * audible.amplitudes
        self._amplitudes: NDArray[np.complex128] = amplitudes.astype(np.complex128)
        self._state: NDArray[np.complex128] = np.zeros(rates.size, np.complex128)
        self._strikes: list[tuple[int, float]] = []
        self._n_samples = 0
        self._oscillation: NDArray[np.complex128] = np.zeros((rates.size, 0), np.complex128)

    def strike(self, impulse_ns: float, delay_samples: int) -> None:
        """Strike the body within the samples that `emit` returns next.

        Args:
            impulse_ns: Impulse in newton seconds.
            delay_samples: Samples from the beginning of the next call of `emit`.
        """
        self._strikes.append((delay_samples, impulse_ns))

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self._state[:] = 0.0
        self._strikes.clear()

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        pressure = np.zeros(n_samples)
        if not self._strikes and not self._state.any():
            return pressure.astype(np.float32)
        self._prepare(n_samples)
        excited = [(0, self._state)]
        for delay, impulse in self._strikes:
            excited.append((min(delay, n_samples - 1), impulse * self._amplitudes))
        after = np.zeros_like(self._state)
        for delay, state in excited:
            rest = n_samples - delay
            pressure[delay:] += (state @ self._oscillation[:, :rest]).imag
            after += state * self._oscillation[:, rest]
        after[np.abs(after) < _INAUDIBLE] = 0.0
        self._state = after
        self._strikes.clear()
        return pressure.astype(np.float32)

    def _prepare(self, n_samples: int) -> None:
        if n_samples != self._n_samples:
            self._n_samples = n_samples
            time = np.arange(n_samples + 1)
            self._oscillation = np.exp(np.outer(self._step_per_sample, time))

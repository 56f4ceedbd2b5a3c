"""Materials of things that sound when they are hit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum


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

"""Sounds of things that hit each other: materials, modes of vibration, and struck bodies."""

from veca_marl.sim.sound.impacts.materials import MATERIALS, Material, MaterialProperties
from veca_marl.sim.sound.impacts.struck_body import StruckBody
from veca_marl.sim.sound.modal_synthesis import Modes, acceleration_noise, bar_modes, sphere_modes

__all__ = [
    "MATERIALS",
    "Material",
    "MaterialProperties",
    "Modes",
    "StruckBody",
    "acceleration_noise",
    "bar_modes",
    "sphere_modes",
]

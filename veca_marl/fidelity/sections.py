"""The sections of the page, in its order. A module is imported when its section is measured."""

from __future__ import annotations

from importlib import import_module

from veca_marl.fidelity.law import Section
from veca_marl.registry import unknown

SECTIONS: dict[str, str] = {
    "collisions": "veca_marl.fidelity.collisions",
    "doppler": "veca_marl.fidelity.doppler",
    "ears": "veca_marl.fidelity.ears",
    "inertia": "veca_marl.fidelity.inertia",
    "joints": "veca_marl.fidelity.joints",
    "localisation": "veca_marl.fidelity.localisation",
    "momentum": "veca_marl.fidelity.momentum",
    "near_field": "veca_marl.fidelity.near_field",
    "rigid_bodies": "veca_marl.fidelity.rigid_bodies",
    "rooms": "veca_marl.fidelity.rooms",
    "touch": "veca_marl.fidelity.touch",
    "vision": "veca_marl.fidelity.vision",
}
"""Module of each section. It has a function ``section() -> Section``."""


def check_names(names: list[str]) -> None:
    """Check that sections exist.

    Raises:
        ValueError: If one does not; the message lists all.
    """
    for name in names:
        if name not in SECTIONS:
            raise ValueError(unknown("section", name, list(SECTIONS)))


def measure(name: str) -> Section:
    """Return the measured section with this name."""
    section: Section = import_module(SECTIONS[name]).section()
    return section

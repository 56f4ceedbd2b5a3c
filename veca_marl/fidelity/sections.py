"""The sections of the page, in its order. A module is imported when its section is measured."""

from __future__ import annotations

from importlib import import_module

from veca_marl.fidelity.law import Section
from veca_marl.registry import unknown

SECTIONS: dict[str, str] = {
    "collisions": "veca_marl.fidelity.mechanics.collisions",
    "doppler": "veca_marl.fidelity.hearing.doppler",
    "ears": "veca_marl.fidelity.hearing.ears",
    "inertia": "veca_marl.fidelity.mechanics.inertia",
    "joints": "veca_marl.fidelity.mechanics.joints",
    "localisation": "veca_marl.fidelity.hearing.localisation",
    "momentum": "veca_marl.fidelity.mechanics.momentum",
    "near_field": "veca_marl.fidelity.hearing.near_field",
    "rigid_bodies": "veca_marl.fidelity.mechanics.rigid_bodies",
    "rooms": "veca_marl.fidelity.hearing.rooms",
    "touch": "veca_marl.fidelity.touch",
    "vision": "veca_marl.fidelity.vision.eyes",
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

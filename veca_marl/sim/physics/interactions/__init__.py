"""Verbs: what bodies do with props when an action names it, and the registry of verbs."""

from veca_marl.sim.body.verbs import Grab, Release
from veca_marl.sim.physics.interactions.foot import FootInteraction
from veca_marl.sim.physics.interactions.grip import Grip
from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction, Verb
from veca_marl.sim.physics.interactions.kick import Kick
from veca_marl.sim.physics.interactions.open_close import Close, Open
from veca_marl.sim.physics.interactions.posture import Crawl, StandUp, StepOn
from veca_marl.sim.physics.interactions.press import Press
from veca_marl.sim.physics.interactions.put_into import PutInto
from veca_marl.sim.physics.interactions.rays import free_path_m, surface_m
from veca_marl.sim.physics.interactions.registry import (
    INTERACTIONS,
    NO_VERB,
    check_interactions,
    register_interaction,
)

__all__ = [
    "INTERACTIONS",
    "NO_VERB",
    "Close",
    "Crawl",
    "FootInteraction",
    "Grab",
    "Grip",
    "InteractingBody",
    "Interaction",
    "Kick",
    "Open",
    "Press",
    "PutInto",
    "Release",
    "StandUp",
    "StepOn",
    "Verb",
    "check_interactions",
    "free_path_m",
    "register_interaction",
    "surface_m",
]

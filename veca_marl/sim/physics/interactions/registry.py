"""The registry of verbs, to which plug-ins add their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from veca_marl.registry import Registry, unknown
from veca_marl.sim.physics.interactions.interaction import Verb

INTERACTIONS: Registry[type[Verb]] = Registry("interaction")
VerbT = TypeVar("VerbT", bound=type[Verb])


def register_interaction(verb: VerbT) -> VerbT:
    """Register a verb by its `name`; a class decorator.

    Raises:
        ValueError: If another verb has this name, or the class's name is no identifier in text.
    """
    name = getattr(verb, "name", "")
    # the name is a choice in configurations and on command lines, where a space would split it
    if not isinstance(name, str) or not name.isidentifier() or name == NO_VERB:
        raise ValueError(
            f"{verb.__name__}.name={name!r} must name the verb by an identifier in text, such as "
            f"'lift_up', and not {NO_VERB!r}"
        )
    INTERACTIONS.add(name, verb)
    return verb


NO_VERB = "none"
"""The choice of the action part `verb` that does nothing."""


def check_interactions(field: str, names: Sequence[str]) -> None:
    """Check names of verbs in a configuration.

    Raises:
        ValueError: If one is unknown or named twice; the message begins with the field.
    """
    for name in names:
        if name not in INTERACTIONS:
            raise ValueError(f"{field}: {unknown('interaction', name, INTERACTIONS)}")
    if len(set(names)) < len(names):
        raise ValueError(f"{field}={list(names)}: each interaction can be named once")

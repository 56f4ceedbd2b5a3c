"""The `verb` part of a walker's action, and the verbs of all walkers of one step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from veca_marl.sim.body.sight import distance_m
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.interactions import INTERACTIONS, NO_VERB, InteractingBody, Verb
from veca_marl.sim.spec import ArraySpec, discrete_spec

VERB = "verb"  # the part's name
REFUSED = "refused_verbs"
"""Name of the entry of `info` that counts verbs without effect."""


def verb_spec(verbs: Sequence[str]) -> dict[str, ArraySpec]:
    """Return the part of the action that chooses a verb; empty for a body that has none."""
    return {VERB: discrete_spec((NO_VERB, *verbs))} if verbs else {}


class Applied(NamedTuple):
    """A verb that had an effect.

    Attributes:
        verb: Its name.
        prop: What it was applied to; None for a verb without an object.
    """

    verb: str
    prop: Prop | None


class VerbChoice:
    """The verb that one body has chosen, and what became of it.

    Args:
        verbs: Names of the verbs, in the order of their choices.

    Attributes:
        applied: The verb that had an effect in the last agent step; None if there was none.
        refused: Whether a verb was chosen in the last agent step that had no effect.
    """

    def __init__(self, verbs: Sequence[str]) -> None:
        self.names = (NO_VERB, *verbs)
        self._verbs: list[Verb | None] = [None, *(INTERACTIONS.find(name)() for name in verbs)]
        self.reset()

    def reset(self) -> None:
        """Choose nothing."""
        self._chosen: Verb | None = None
        self.applied: Applied | None = None
        self.refused = False

    def choose(self, index: int) -> None:
        """Choose the verb of the next agent step; 0 is none."""
        self._chosen = self._verbs[index]

    def index(self, name: str) -> int:
        """Return the choice that stands for a verb.

        Raises:
            ValueError: If it is not among the verbs of the body.
        """
        if name not in self.names:
            raise ValueError(f"verb {name!r}; this body has {list(self.names)}: body.verbs")
        return self.names.index(name)

    def take(self) -> Verb | None:
        """Return the chosen verb, and choose nothing."""
        chosen, self._chosen = self._chosen, None
        self.applied, self.refused = None, False
        return chosen

    def record(self, verb: Verb, prop: Prop | None, effective: bool) -> None:
        """Store the result of an attempt."""
        self.applied = Applied(verb.name, prop) if effective else None
        self.refused = not effective


class VerbUser(InteractingBody, Protocol):
    """A body that chooses verbs.

    Attributes:
        verb_choice: Its choice.
    """

    verb_choice: VerbChoice


class _Attempt(NamedTuple):
    distance_m: float
    number: int
    body: VerbUser
    verb: Verb
    target: Prop | None


def apply_verbs(bodies: Sequence[VerbUser]) -> None:
    """Apply the chosen verbs of all bodies of a world, before the physics of an agent step.

    All targets are determined before the first verb is applied. Then the body that is nearest to
    its target comes first, so that of two bodies that grab the same prop the nearer one gets it;
    bodies at equal distances act in the order in which they were added to the world.

    Args:
        bodies: In the order in which they were added.
    """
    attempts = []
    for number, body in enumerate(bodies):
        verb = body.verb_choice.take()
        if verb is not None:
            target = verb.target(body)
            attempts.append(
                _Attempt(_distance_m(body.position, target), number, body, verb, target)
            )
    for attempt in sorted(attempts, key=lambda one: (one.distance_m, one.number)):
        effective = attempt.verb.attempt(attempt.body, attempt.target)
        attempt.body.verb_choice.record(attempt.verb, attempt.target, effective)


def _distance_m(position: Floats, target: Prop | None) -> float:
    return 0.0 if target is None else distance_m(target, position)

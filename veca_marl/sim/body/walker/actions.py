"""The parts of a walker's action: velocities or moves, and verbs."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.sense_organs import distance_m
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.interactions import INTERACTIONS, NO_VERB, InteractingBody, Verb
from veca_marl.sim.sense import ArraySpec, continuous_spec, discrete_spec
from veca_marl.sim.sound import Call

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


# (forward, turn) as fractions of the greatest speeds; turning left is positive
MOVES: dict[str, tuple[float, float]] = {
    "stand": (0.0, 0.0),
    "forward": (1.0, 0.0),
    "backward": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
    "forward_left": (1.0, 1.0),
    "forward_right": (1.0, -1.0),
}


class WalkCommand(NamedTuple):
    """What an expert commands a walker to do in the next step.

    Attributes:
        forward: Walking velocity as a fraction of the greatest, in [-1, 1].
        turn: Turning velocity likewise, left positive.
        call: The call; ignored by a body without the action part `voice`.
        verb: Name of the verb, see `WalkerCfg.verbs`.
    """

    forward: float
    turn: float
    call: Call = Call.none
    verb: str = NO_VERB


class WalkAction(Protocol):
    """Converts between the `move` part and fractions of the greatest walking and turning speed.

    Attributes:
        spec: Of the part.
    """

    spec: ArraySpec

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return (forward, turn), each in [-1, 1], for a value that the spec admits."""
        ...

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the value of the part that comes nearest to (forward, turn)."""
        ...


class ContinuousWalk:
    """Two numbers ``(2,)``: forward and turning velocity in [-1, 1], left positive."""

    spec = continuous_spec(("forward", "turn"))

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return the two numbers."""
        return float(move[0]), float(move[1])

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the two numbers, clipped to [-1, 1]."""
        return np.clip(np.array([forward, turn], np.float32), self.spec.low, self.spec.high)


class DiscreteWalk:
    """One of `MOVES`, by its index."""

    spec = discrete_spec(tuple(MOVES))
    _moves = tuple(MOVES.values())

    def decode(self, move: NDArray[Any]) -> tuple[float, float]:
        """Return the fractions of the chosen move."""
        return self._moves[int(move)]

    def encode(self, forward: float, turn: float) -> NDArray[Any]:
        """Return the index of the move with the nearest fractions."""
        away = np.array(self._moves) - (forward, turn)
        return np.asarray(np.argmin((away**2).sum(axis=1)), self.spec.dtype)


class WalkActionKind(Enum):
    """Whether the `move` part is continuous or discrete."""

    continuous = "continuous"
    discrete = "discrete"


WALK_ACTIONS: dict[WalkActionKind, WalkAction] = {
    WalkActionKind.continuous: ContinuousWalk(),
    WalkActionKind.discrete: DiscreteWalk(),
}

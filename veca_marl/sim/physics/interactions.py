"""The base classes of verbs, what they use of a body, and their registry, to which plug-ins add.

The verbs themselves are in `veca_marl.sim.body.verbs`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

import numpy as np

from veca_marl.registry import Registry, unknown
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.props.prop import Prop

if TYPE_CHECKING:
    from veca_marl.sim.physics.world import World


class InteractingBody(Protocol):
    """What verbs use of a body; `Walker` has all of it.

    Attributes:
        name: Unique in its world.
    """

    name: str

    @property
    def world(self) -> World:
        """The world in which it is."""
        ...

    @property
    def position(self) -> Floats:
        """``(3,)`` metres: the pelvis in the world frame."""
        ...

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector that the trunk faces."""
        ...

    @property
    def held(self) -> Prop | None:
        """The prop in its hand; None if the hand is empty."""
        ...

    def interactable_objects(self, where: Callable[[Prop], bool] | None = None) -> list[Prop]:
        """Return the interactable props that meet a condition, nearest to the centre first."""
        ...

    def interactable_object(self) -> Prop | None:
        """Return the interactable prop nearest to the centre of the view."""
        ...

    def is_light(self, prop: Prop) -> bool:
        """Return whether it moves a prop by the paper's rule of light and heavy objects."""
        ...

    def can_kick(self, prop: Prop) -> bool:
        """Return whether a kick would reach a prop."""
        ...

    def kick(self, prop: Prop) -> bool:
        """Kick a prop; return False, without effect, if it cannot."""
        ...

    def can_grab(self, prop: Prop) -> bool:
        """Return whether it can take a prop into its hand."""
        ...

    def grab(self, prop: Prop) -> bool:
        """Take a prop into the hand; return False, without effect, if it cannot."""
        ...

    def release(self) -> bool:
        """Release the held prop; return False, without effect, if the hand is empty."""
        ...

    def can_step_on(self, prop: Prop) -> bool:
        """Return whether it can step onto a prop."""
        ...

    def step_on(self, prop: Prop) -> bool:
        """Step onto a prop; return False, without effect, if it cannot."""
        ...

    def crawl(self) -> bool:
        """Go down on hands and knees; return False, without effect, if it cannot."""
        ...

    def stand_up(self) -> bool:
        """Stand up; return False, without effect, if it cannot."""
        ...


class Verb(ABC):
    """One choice of the action part `verb`. It has no state: one object serves all bodies.

    Attributes:
        name: As in `WalkerCfg.verbs` and `PropCfg.interactions`.
    """

    name: ClassVar[str]

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the prop that the verb would be applied to at present; None if there is none."""
        return None

    @abstractmethod
    def attempt(self, body: InteractingBody, target: Prop | None) -> bool:
        """Apply the verb where it is allowed.

        Args:
            body: The body that acts.
            target: What `target` returned before any body of the world acted in this step.

        Returns:
            Whether it had an effect; if not, nothing was changed.
        """


class Interaction(Verb):
    """A verb that is applied to a prop: to the first of `interactable_objects()` that declares it.

    Things that declare other verbs, such as an open drawer, do not hide what lies in them.

    A subclass is registered with `register_interaction`. Its effect lasts at most until the world
    is reset if it is made by the public methods of the body and the prop.
    """

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the prop nearest to the centre of the view of those that declare the verb."""
        return next(iter(body.interactable_objects(self.declared_by)), None)

    def attempt(self, body: InteractingBody, target: Prop | None) -> bool:
        """Apply the verb to the target if the prop declares it and `allows` returns True."""
        if target is None or not self.declared_by(target) or not self.allows(body, target):
            return False
        self.apply(body, target)
        return True

    def declared_by(self, prop: Prop) -> bool:
        """Return whether the configuration of a prop names this verb."""
        return self.name in prop.cfg.interactions

    @abstractmethod
    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether a body can do this with a prop that declares it, in the present state."""

    @abstractmethod
    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Do it. Called before the physics steps of an agent step, only if `allows` is True."""


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


class FootInteraction(Interaction):
    """An interaction with a prop in front of the feet, which the body need not see.

    What a foot reaches is mostly below the view of an agent that looks ahead.
    """

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the prop that is most nearly ahead of those that the foot reaches.

        If it reaches none, it is the one in view, as with other interactions.
        """
        reached = [
            prop
            for prop in body.world.props.values()
            if self.declared_by(prop) and self.allows(body, prop)
        ]
        if not reached:
            return super().target(body)
        return max(reached, key=lambda prop: _cos_ahead(body, prop))


def _cos_ahead(body: InteractingBody, prop: Prop) -> float:
    """Return the cosine of the horizontal angle between heading and direction of a prop."""
    way = (prop.position - body.position)[:2]
    return float(way @ body.forward[:2]) / max(float(np.linalg.norm(way)), 1e-9)

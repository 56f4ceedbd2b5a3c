"""Verbs: what bodies do with props when an action names it, and the registry of verbs.

They are here and not with the bodies because a world checks the verbs that its props name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from veca_marl.registry import Registry, unknown
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.physics.props.filling import fits, is_covered, place_above
from veca_marl.sim.physics.props.prop import Prop


class WorldWithProps(Protocol):
    """What verbs use of a world; `World` has all of it.

    Attributes:
        client: The PyBullet client.
        props: Its props by name.
    """

    client: BulletClient
    props: dict[str, Prop]


class InteractingBody(Protocol):
    """What verbs use of a body; `Walker` has all of it.

    Attributes:
        name: Unique in its world.
    """

    name: str

    @property
    def world(self) -> WorldWithProps:
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


@register_interaction
class Grab(Interaction):
    """Take a light prop into the empty hand, unless another body holds it."""

    name: ClassVar[str] = "grab"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the hand is empty and the prop is light and no other body holds it."""
        return body.can_grab(prop)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Hold the prop: from now on it follows the hand."""
        body.grab(prop)


@register_interaction
class Release(Interaction):
    """Release the held prop, which falls. Every held prop can be released."""

    name: ClassVar[str] = "release"

    def target(self, body: InteractingBody) -> Prop | None:
        """Return the held prop."""
        return body.held

    def declared_by(self, prop: Prop) -> bool:
        """Return True: a prop that can be grabbed can be released."""
        return True

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the body holds the prop."""
        return body.held is prop

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Open the hand."""
        body.release()


@register_interaction
class Kick(FootInteraction):
    """Kick a light prop that is ahead and within reach of the foot, see `Walker.can_kick`."""

    name: ClassVar[str] = "kick"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the foot reaches the prop."""
        return body.can_kick(prop)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Give the prop the velocity of a kick."""
        body.kick(prop)


_END = 0.99  # an opening from which a joint counts as open


@register_interaction
class Open(Interaction):
    """Let the motor of a joint open it; what is locked needs its key in the hand.

    The key stays in the hand, and the joint unlocked.
    """

    name: ClassVar[str] = "open"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the joint is not open, and not locked or its key is held."""
        if prop.joint is None or prop.opening > _END:
            return False
        return not prop.locked or (body.held is not None and prop.takes(body.held))

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Unlock it if it is locked, and start the motor."""
        if prop.locked and body.held is not None:
            prop.unlock(body.held)
        prop.open()


@register_interaction
class Close(Interaction):
    """Let the motor of a joint close it."""

    name: ClassVar[str] = "close"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the joint is neither closed nor locked."""
        return prop.joint is not None and not prop.locked and prop.opening > 1.0 - _END

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Start the motor."""
        prop.close()


@register_interaction
class StepOn(FootInteraction):
    """Step onto the middle of a low, heavy prop, see `Walker.can_step_on`.

    The walker walks on its surface, and steps down when it walks over an edge.
    """

    name: ClassVar[str] = "step_on"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the prop is heavy, low and within reach of the foot."""
        return body.can_step_on(prop)

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Stand on the prop."""
        body.step_on(prop)


@register_interaction
class Crawl(Verb):
    """Go down on hands and knees, with empty hands; see `Walker.crawl`."""

    name: ClassVar[str] = "crawl"

    def attempt(self, body: InteractingBody, target: Prop | None) -> bool:
        """Crawl; return False if the body already does, or holds or stands on something."""
        return body.crawl()


@register_interaction
class StandUp(Verb):
    """Stand up from crawling, where there is room."""

    name: ClassVar[str] = "stand_up"

    def attempt(self, body: InteractingBody, target: Prop | None) -> bool:
        """Stand up; return False if the body stands already or something is above it."""
        return body.stand_up()


@register_interaction
class Press(Interaction):
    """Press a prop. It moves nothing: a task reads `Walker.applied_verb` after the step."""

    name: ClassVar[str] = "press"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return True: every interactable prop that declares it can be pressed."""
        return True

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Change nothing in the world."""


@register_interaction
class PutInto(Interaction):
    """Release the held prop above the emptiest place of a container, into which it falls.

    The container declares the verb. The prop must be held, be narrower than the inside of the
    container, and be accepted by it (`Prop.accepts`), and no closed lid may be above it.
    """

    name: ClassVar[str] = "put_into"

    def allows(self, body: InteractingBody, prop: Prop) -> bool:
        """Return whether the held prop fits into the container and is accepted by it."""
        held = body.held
        if held is None or not fits(held, prop) or not prop.accepts(held):
            return False
        return not is_covered(held, prop, body.world.props.values())

    def apply(self, body: InteractingBody, prop: Prop) -> None:
        """Open the hand and place the prop above the container, at rest, with its yaw."""
        held = body.held
        if held is not None:
            body.release()
            held.place(held.position, prop.yaw_rad)
            held.place(place_above(held, prop, body.world.props.values()), prop.yaw_rad)

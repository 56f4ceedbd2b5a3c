"""The base classes of verbs: what a body does when an action names the verb."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Protocol

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.props.prop import Prop

if TYPE_CHECKING:  # the world checks the names of interactions
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

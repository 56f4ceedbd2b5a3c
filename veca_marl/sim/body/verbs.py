"""The verbs: what bodies do with props when an action names it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.interactions import (
    FootInteraction,
    InteractingBody,
    Interaction,
    Verb,
    register_interaction,
)
from veca_marl.sim.physics.props.prop import Prop
from veca_marl.sim.physics.props.prop_cfg import PropShape


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


_GAP_M = 0.01  # between the lowest point of the prop and what it falls on, or the rim
_RIM_M = 0.02  # thickness of the walls of a container
# corners, middle and edges of a container, as shares of the way from the middle to the rim
_PLACES = np.array(
    [(1, 1), (-1, -1), (1, -1), (-1, 1), (0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], np.float64
)


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


def fits(prop: Prop, container: Prop) -> bool:
    """Return whether a prop is narrower than the inside of a container."""
    low, high = container.box
    wall_m = _RIM_M if container.cfg.shape is PropShape.compound else 0.0  # plates have none
    return 2.0 * (prop.radius_m + wall_m) <= float(np.min((high - low)[:2]))


def is_covered(prop: Prop, container: Prop, others: Iterable[Prop]) -> bool:
    """Return whether a lid, or another leaf, is above each place in a container for a prop.

    Args:
        prop: The prop.
        container: The container, upright.
        others: All props of the world.
    """
    leaves = [_in_frame(p, container) for p in others if p.joint is not None and p is not container]
    half = np.full(2, prop.radius_m)
    piles = [_pile_m(place - half, place + half, leaves) for place in _places(container, half)]
    return min(piles) > -np.inf


def place_above(prop: Prop, container: Prop, others: Iterable[Prop]) -> Floats:
    """Return where a prop is free above a container and what lies in it, ``(3,)`` metres.

    Of the corners, the middle and the edges of the container it is the place above the lowest pile;
    of equal ones the first. Piles are measured by the bounding boxes of movable props.

    Args:
        prop: Upright, with the yaw of the container, elsewhere.
        container: The container, upright.
        others: All props of the world.
    """
    (_, high), (own_low, own_high) = container.box, prop.box
    half = (own_high - own_low)[:2] / 2.0
    places = _places(container, half)
    piles = [_in_frame(p, container) for p in others if p not in (prop, container) and not p.fixed]
    heights = [_pile_m(place - half, place + half, piles) for place in places]
    best = int(np.argmin(heights))
    bottom_m = max(heights[best], float(high[2])) + _GAP_M
    middle = (own_low + own_high)[:2] / 2.0
    local = np.array([*(places[best] - middle), bottom_m - own_low[2]])
    world: Floats = container.position + container.rotation @ local
    return world


def _places(container: Prop, half: Floats) -> Floats:
    """Return places ``(9, 2)`` in a container's frame for a prop of half widths ``(2,)``."""
    low, high = container.box
    reach = np.maximum((high - low)[:2] / 2.0 - half - _RIM_M, 0.0)
    places: Floats = ((low + high) / 2.0)[:2] + _PLACES * reach
    return places


def _in_frame(prop: Prop, container: Prop) -> tuple[Floats, Floats]:
    """Return the corners of a box about the bounding box of a prop in the container's frame."""
    low, high = prop.bounds()
    middle = container.rotation.T @ ((low + high) / 2.0 - container.position)
    half = np.abs(container.rotation.T) @ ((high - low) / 2.0)
    return middle - half, middle + half


def _pile_m(low: Floats, high: Floats, piles: Sequence[tuple[Floats, Floats]]) -> float:
    """Return the height of the highest box that overlaps a rectangle; minus infinity if none."""
    overlapping = [
        float(top[2])
        for bottom, top in piles
        if (bottom[:2] < high).all() and (top[:2] > low).all()
    ]
    return max(overlapping, default=-np.inf)

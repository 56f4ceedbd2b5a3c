"""Verbs that change how a walker moves: stepping on a prop, crawling, standing up."""

from __future__ import annotations

from typing import ClassVar

from veca_marl.sim.physics.interactions.foot import FootInteraction
from veca_marl.sim.physics.interactions.interaction import InteractingBody, Verb
from veca_marl.sim.physics.interactions.registry import register_interaction
from veca_marl.sim.physics.props.prop import Prop


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

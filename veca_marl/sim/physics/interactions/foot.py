"""The base class of verbs of the feet, which reach what is below the view."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.physics.interactions.interaction import InteractingBody, Interaction
from veca_marl.sim.physics.props.prop import Prop


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

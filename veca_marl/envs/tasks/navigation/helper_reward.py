"""The paper's helper reward of navigation tasks: motion towards an object while it is visible."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Scene
from veca_marl.sim.physics import Prop
from veca_marl.sim.vision import EyeViews, VisionCfg, VisionSense


class Displacement(NamedTuple):
    """Horizontal displacement of a body during one step, in components.

    Attributes:
        ahead_m: Forward component.
        aside_m: Lateral component, positive towards the side on which the object is.
    """

    ahead_m: float
    aside_m: float


def displacement_to(body: Body, target: Floats, step_s: float) -> Displacement:
    """Return the two components of the paper's helper reward of ObjectNav and MultiAgentNav.

    The reward in the paper (appendix, "ObjectNav & MultiAgentNav") is
    ``Vis * (0.05 a_f + 0.03 a_l L)`` with the velocity's forward and left components and L = 1 or
    -1 for an object on the left or right. The paper gives no unit. Here the velocity is in metres
    per step: in metres per second, 25 times as much, going to and fro in front of an object has a
    higher return than reaching it.

    Args:
        body: The body.
        target: Position of the object, ``(3,)`` metres.
        step_s: Duration of an environment step.
    """
    forward, way = body.forward, body.velocity * step_s
    left = np.array([-forward[1], forward[0], 0.0])
    side = float(np.sign(left @ (target - body.position)))
    return Displacement(float(forward @ way), float(left @ way) * side)


class PropVisibility:
    """Visibility of one prop to players, by the images of their eyes.

    The images are those of a player's sense of vision, with its field of view, resolution and
    number of open eyes; asking costs no further rendering where the player observes them. Without
    that sense they are those of two eyes with the defaults of `VisionCfg`.

    Args:
        scene: The scene that eyes see.
        prop: The prop.
    """

    def __init__(self, scene: Scene, prop: Prop) -> None:
        self._scene, self._prop = scene, prop
        self._without_sense: dict[str, EyeViews] = {}

    def for_player(self, player: Player) -> bool:
        """Return whether at least one pixel of an open eye of a player shows the prop."""
        return self._eyes_of(player).is_visible(self._prop.object_id)

    def _eyes_of(self, player: Player) -> EyeViews:
        sense = player.senses.get("vision")
        if isinstance(sense, VisionSense):
            return sense.eyes
        eyes = self._without_sense.get(player.name)
        if eyes is None:
            eyes = EyeViews(self._scene, player.body, VisionCfg().camera())
            self._without_sense[player.name] = eyes
        return eyes

"""The paper's helper reward of navigation tasks: motion towards an object while it is visible."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.core.task import Player, horizontal_angle_rad
from veca_marl.sim.geometry import Floats, Scene
from veca_marl.sim.physics import Prop
from veca_marl.sim.vision import EyeViews, VisionCfg, VisionSense

AHEAD_WEIGHT, TURN_WEIGHT = 0.05, 0.03  # those of a_f and a_l in the paper


class HelperReward:
    """The terms `ahead` and `turn` of ObjectNav and MultiAgentNav.

    The reward in the paper (appendix, "ObjectNav & MultiAgentNav") is
    ``Vis * (0.05 a_f + 0.03 a_l L)``: a_f and a_l are the forward and the left component of the
    velocity, L is 1 or -1 for an object on the left or right, Vis is 1 while the object is visible.
    The paper gives no unit. The two components are read as follows:

    - ``ahead`` (a_f) is the displacement of the body along its forward direction during the step,
      m. In metres per second, 25 times as much, going to and fro in front of an object has a higher
      return than reaching it.
    - ``turn`` (a_l L) is the decrease of the horizontal angle between the forward direction and the
      direction of the object since the object was last visible, rad. The action of the paper's
      walking body is ``walk(walk_speed, turn_speed)``: it has no velocity to the side, and reaches
      an object on the left by turning left. The sum depends only on the first and the last angle
      at which the object was visible: turning to and fro adds nothing, also if the object is out
      of sight in between.

    Both are 0 unless the object is visible after the step. The sum of ``ahead`` has no bound: an
    agent that walks in a circle near the object, and sees it on its way there but not on its way
    back, is paid in every round. With weights several times as large as the paper's agents may
    learn that instead of reaching the object.

    Args:
        scene: The scene that eyes see.
    """

    def __init__(self, scene: Scene) -> None:
        self._visibility = PropVisibility(scene)
        self._prop: Prop | None = None
        self._begins = False
        self._positions: dict[str, Floats] = {}
        self._angles_rad: dict[str, float] = {}
        self._terms: dict[str, dict[str, float]] = {}

    def reset(self, prop: Prop, players: Sequence[Player]) -> None:
        """Begin an episode. Called after the players have been placed.

        Args:
            prop: The object.
            players: All players.
        """
        self._prop, self._terms, self._angles_rad = prop, {}, {}
        self._positions = {player.name: player.body.position for player in players}
        self._begins = True

    def before_step(self, players: Sequence[Player]) -> None:
        """Measure the angles at the start of an episode. Called once per step, before it.

        At a reset the eyes do not see yet how bodies have been placed.

        Args:
            players: All players.
        """
        if self._begins and self._prop is not None:
            self._angles_rad = {
                player.name: _angle_rad(self._prop, player)
                for player in players
                if self.sees(self._prop, player)
            }
        self._begins = False

    def after_step(self, players: Sequence[Player]) -> None:
        """Compute the terms of a step. Called once per step, after the eyes have been directed.

        Args:
            players: The players that still search; the terms of the others are 0.
        """
        self._terms = {}
        for player in players:
            name, position = player.name, player.body.position
            way, self._positions[name] = position - self._positions[name], position
            if self._prop is not None and self.sees(self._prop, player):
                angle_rad = _angle_rad(self._prop, player)
                turned_rad = self._angles_rad.get(name, angle_rad) - angle_rad
                self._angles_rad[name] = angle_rad
                ahead_m = float(way @ player.body.forward)
                self._terms[name] = {"ahead": ahead_m, "turn": turned_rad}

    def terms(self, player: Player) -> dict[str, float]:
        """Return the terms `ahead`, m, and `turn`, rad, of a player in the last step."""
        return self._terms.get(player.name, {"ahead": 0.0, "turn": 0.0})

    def sees(self, prop: Prop, player: Player) -> bool:
        """Return whether a prop is visible to an eye of a player, see `PropVisibility`."""
        return self._visibility.of(prop, player)


def _angle_rad(prop: Prop, player: Player) -> float:
    """Return the horizontal angle between a player's forward direction and that of a prop."""
    return horizontal_angle_rad(prop.position - player.body.position, player.body.forward)


class PropVisibility:
    """Visibility of props to players, by the images of their eyes.

    The images are those of a player's sense of vision, with its field of view, resolution and
    number of open eyes; asking costs no further rendering where the player observes them. Without
    that sense they are those of two eyes with the defaults of `VisionCfg`.

    Args:
        scene: The scene that eyes see.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._without_sense: dict[str, EyeViews] = {}

    def of(self, prop: Prop, player: Player) -> bool:
        """Return whether at least one pixel of an open eye of a player shows a prop."""
        return self._eyes_of(player).is_visible(prop.object_id)

    def _eyes_of(self, player: Player) -> EyeViews:
        sense = player.senses.get("vision")
        if isinstance(sense, VisionSense):
            return sense.eyes
        eyes = self._without_sense.get(player.name)
        if eyes is None:
            eyes = EyeViews(self._scene, player.body, VisionCfg().camera())
            self._without_sense[player.name] = eyes
        return eyes

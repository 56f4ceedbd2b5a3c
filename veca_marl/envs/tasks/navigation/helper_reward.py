"""The paper's helper reward of navigation tasks: motion towards an object while it is visible."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.core.scoring import horizontal_angle_rad
from veca_marl.envs.core.task import Player
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
    - ``turn`` (a_l L) is the decrease during the step of the horizontal angle between the forward
      direction and the direction of the object, rad. The action of the paper's walking body is
      ``walk(walk_speed, turn_speed)``: it has no velocity to the side, and reaches an object on the
      left by turning left. While the object stays visible the sum depends only on the first and the
      last angle: turning to and fro adds nothing.

    Both are 0 unless the object is visible after the step; `turn` is 0 unless it was visible before
    the step, too.

    Args:
        scene: The scene that eyes see.
    """

    def __init__(self, scene: Scene) -> None:
        self._visibility = PropVisibility(scene)
        self._prop: Prop | None = None
        self._positions: dict[str, Floats] = {}
        self._angles_rad: dict[str, float] = {}
        self._terms: dict[str, dict[str, float]] = {}

    def reset(self, prop: Prop, players: Sequence[Player]) -> None:
        """Begin an episode. Called after the players have been placed.

        Args:
            prop: The object.
            players: All players.
        """
        self._prop = prop
        self._positions = {player.name: player.body.position for player in players}
        self._angles_rad, self._terms = {}, {}

    def after_step(self, players: Sequence[Player]) -> None:
        """Compute the terms of a step. Called once per step, after the eyes have been directed.

        Args:
            players: The players that still search; the terms of the others are 0.
        """
        before_rad, self._angles_rad, self._terms = self._angles_rad, {}, {}
        for player in players:
            position, forward = player.body.position, player.body.forward
            way, self._positions[player.name] = position - self._positions[player.name], position
            if self._prop is not None and self.sees(self._prop, player):
                angle_rad = horizontal_angle_rad(self._prop.position - position, forward)
                turned_rad = before_rad.get(player.name, angle_rad) - angle_rad
                self._angles_rad[player.name] = angle_rad
                self._terms[player.name] = {"ahead": float(way @ forward), "turn": turned_rad}

    def terms(self, player: Player) -> dict[str, float]:
        """Return the terms `ahead`, m, and `turn`, rad, of a player in the last step."""
        return self._terms.get(player.name, {"ahead": 0.0, "turn": 0.0})

    def sees(self, prop: Prop, player: Player) -> bool:
        """Return whether a prop is visible to an eye of a player, see `PropVisibility`."""
        return self._visibility.of(prop, player)


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

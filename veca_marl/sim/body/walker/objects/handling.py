"""What a walker does with light props: it holds one in its right hand, and kicks."""

from __future__ import annotations

from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.ground_motion import GroundMotion
from veca_marl.sim.body.walker.handling import Hand
from veca_marl.sim.body.walker.objects.kicks import foot_reaches, kicked_velocity
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop


class ObjectHandling:
    """The right hand and the kicking foot of one walker.

    Args:
        client: PyBullet's client id.
        name: Name of the walker.
        cfg: Its parameters.
        motion: Its motion; a held prop follows it.
        gait: Its gait, which shows kicks and the arm that holds a prop.
    """

    def __init__(
        self, client: int, name: str, cfg: WalkerCfg, motion: GroundMotion, gait: Gait
    ) -> None:
        self._client, self._cfg = client, cfg
        self._motion, self._gait = motion, gait
        self._hand = Hand(client, name, motion.capsule, cfg.radius_m)

    @property
    def held(self) -> Prop | None:
        """The prop in the hand; None if the hand is empty."""
        return self._hand.prop

    def is_light(self, prop: Prop) -> bool:
        """Return whether a prop is not fixed and its mass at most `WalkerCfg.push_limit_kg`."""
        return not prop.fixed and prop.cfg.mass_kg <= self._cfg.push_limit_kg

    def can_kick(self, prop: Prop, position: Floats) -> bool:
        """Return whether a kick reaches a prop, see `Walker.can_kick`.

        Args:
            prop: The prop.
            position: ``(3,)`` metres, of the walker.
        """
        if self._motion.crawls or not self._is_loose(prop):
            return False
        yaw_rad, capsule_id = self._motion.yaw_rad, self._motion.capsule.body_id
        return foot_reaches(self._client, self._cfg, capsule_id, position, yaw_rad, prop)

    def kick(self, prop: Prop, position: Floats) -> bool:
        """Kick a prop; return False, without effect, if the kick does not reach it.

        Args:
            prop: The prop.
            position: ``(3,)`` metres, of the walker.
        """
        if not self.can_kick(prop, position):
            return False
        velocity = kicked_velocity(self._cfg, position, prop)
        prop.set_velocity(velocity, prop.angular_velocity)
        self._gait.kick()
        return True

    def can_grab(self, prop: Prop) -> bool:
        """Return whether a hand is free, and a prop is light, without joint and held by no body."""
        return self.held is None and self._motion.stance.hands_are_free and self._is_loose(prop)

    def grab(self, prop: Prop) -> bool:
        """Hold a prop from now on; return False, without effect, if that is not possible.

        `follow_palm` then moves it to the hand.
        """
        if not self.can_grab(prop):
            return False
        self._hand.take(prop, self._motion.yaw_rad)
        self._hand.collect_obstacles(self._motion.ground, 0.0)
        self._gait.carrying = True
        return True

    def release(self) -> bool:
        """Release the held prop, which falls; return False if the hand is empty."""
        if self.held is None:
            return False
        self.drop()
        self._gait.carrying = False
        return True

    def drop(self) -> None:
        """Hold nothing from now on; nothing is moved."""
        self._hand.drop()

    def before_step(self, step_s: float) -> None:
        """Collect what a held prop can reach within an agent step of a duration in seconds."""
        motion = self._motion
        self._hand.collect_obstacles(motion.ground, abs(motion.speed_mps) * step_s)

    def follow_trunk(self, substep_s: float) -> None:
        """Move a held prop with the trunk by one physics step of a duration in seconds."""
        motion = self._motion
        self._hand.follow(
            motion.ground, motion.yaw_rad, motion.speed_mps, motion.turn_radps, substep_s
        )

    def follow_palm(self, palm: Floats) -> None:
        """Move a held prop to the present place of the palm, ``(3,)`` metres."""
        self._hand.set_palm(palm, self._motion.ground, self._motion.yaw_rad)

    def _is_loose(self, prop: Prop) -> bool:
        """Return whether a prop is light, without joint and held by no body."""
        return prop.holder is None and prop.joint is None and self.is_light(prop)

"""What a walker does with light props: it holds one in its right hand, and kicks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from veca_marl.sim.body.walker.capsule import Capsule
from veca_marl.sim.body.walker.feet import foot_reaches, kicked_velocity
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.ground_motion import GroundMotion
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats, rotation_about_vertical
from veca_marl.sim.physics.bullet import free_path_m, surface_m
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.physics.props.prop import Prop

_TOUCHED_M = 1e-3  # a prop may overlap what it touches by so much


def way_out(client: BulletClient, body_id: int, obstacles: Iterable[int], holder: Floats) -> Floats:
    """Return the displacement ``(3,)`` that moves a body out of obstacles, in metres.

    Each coordinate is that of the deepest overlap along it: several points of one face count once.
    One displacement ends the overlap with walls that are at right angles; others take several.

    Args:
        client: The PyBullet client.
        body_id: PyBullet's id of the body, where it is now.
        obstacles: PyBullet's ids of the obstacles.
        holder: ``(3,)`` metres: a point on the side of all walls on which the body has to be.
    """
    out = np.zeros(3)
    for obstacle in obstacles:
        for point in client.getClosestPoints(body_id, obstacle, 0.0):
            depth_m = -point.distance_m
            if depth_m > _TOUCHED_M:
                way = depth_m * _towards_holder(point.normal_on_b, point.position_on_b, holder)
                out = np.where(np.abs(way) > np.abs(out), way, out)
    return out


def _towards_holder(
    normal: Sequence[float], on_obstacle: Sequence[float], holder: Floats
) -> Floats:
    """Return a unit vector out of an obstacle: its normal, or the way to the holder.

    The shortest way out of a thin wall can lead to its other side.
    """
    way = holder - np.asarray(on_obstacle)
    out = np.asarray(normal)
    return out if float(out @ way) > 0.0 else way / max(float(np.linalg.norm(way)), 1e-9)


class Grip:
    """What one body holds.

    Args:
        client: The PyBullet client.
        holder: Name of the body.
        body_ids: PyBullet's ids of what the held prop does not collide with.

    Attributes:
        prop: The held prop; None if the hand is empty.
    """

    def __init__(self, client: BulletClient, holder: str, body_ids: Sequence[int]) -> None:
        self.prop: Prop | None = None
        self._client = client
        self._holder = holder
        self._body_ids = tuple(body_ids)

    def take(self, prop: Prop) -> None:
        """Hold a prop from now on. It must be held by no other body, and the hand be empty."""
        prop.holder, self.prop = self._holder, prop
        self._set_collision(prop, 0)

    def drop(self) -> None:
        """Hold nothing from now on; nothing is moved."""
        if self.prop is not None:
            self._set_collision(self.prop, 1)
            self.prop.holder, self.prop = None, None

    def carry(self, position: Floats, yaw_rad: float) -> None:
        """Move the held prop to a pose, upright and at rest; see `Prop.set_velocity`."""
        if self.prop is not None:
            self.prop.carry(position, yaw_rad, (0.0, 0.0, 0.0))

    def forget(self) -> None:
        """See `BulletSetting`: let the held prop collide with the body."""
        if self.prop is not None:
            self._set_collision(self.prop, 1)

    def apply(self) -> None:
        """See `BulletSetting`: the held prop does not collide with the body."""
        if self.prop is not None:
            self._set_collision(self.prop, 0)

    def _set_collision(self, prop: Prop, enabled: int) -> None:
        for body_id in self._body_ids:
            for link in prop.links:
                self._client.setCollisionFilterPair(body_id, prop.body_id, -1, link, enabled)


_COMPRESSION_M = 0.002  # of the palm's skin by the held prop, so that the palm feels it
_FLOOR_GAP_M = 0.01  # between the floor and the lowest point of a held prop
_WALL_GAP_M = 0.01  # between a wall and the surface of a held prop
_CLEARANCE_M = 1e-4  # from the surface of the walker's own capsule to the start of a ray
_ARM_M = 0.5  # no palm is farther from the axis of the trunk
# greatest speed of a held prop relative to the trunk, also where it is moved past an edge at once
_ARM_MPS = 1.0
# greatest speed at which things shove the trunk; a walker that is moved out of one is faster
_SHOVED_MPS = 1.0
_ROUNDS = 6  # of moving a prop out of walls; in a corner that is not square each leaves a rest


class Hand:
    """Holds a prop beside the palm, upright, at a constant yaw relative to the trunk.

    Its centre of mass is beside the palm. The prop is kinematic while it is held: its pose is set
    at each physics step, and its velocity is that of this motion, without jumps: neither those of
    the hand at the edges of walls, nor those of a walker that is moved out of something. It does
    not collide with its holder. It stays on the walker's side of walls and of other walkers: where
    they are nearer than the hand would hold it, it is held nearer to the trunk.

    Args:
        client: The PyBullet client.
        holder: Name of the walker.
        capsule: The upright capsule of the walker.
        radius_m: Its radius.

    Attributes:
        grip: What holds the prop.
    """

    def __init__(
        self, client: BulletClient, holder: str, capsule: Capsule, radius_m: float
    ) -> None:
        self._client, self._radius_m = client, radius_m
        self._capsule = capsule
        self.grip = Grip(client, holder, [capsule.body_id])
        self._obstacles: list[int] = []
        self._yaw_rad = self._turn_radps = 0.0
        self._half_width_m = self._below_m = 0.0
        self._offset, self._centre, self._velocity = np.zeros((3, 3))
        self._trunk = (np.zeros(2), 0.0)  # place and heading for which the prop was placed

    @property
    def prop(self) -> Prop | None:
        """The held prop; None if the hand is empty."""
        return self.grip.prop

    def take(self, prop: Prop, yaw_rad: float) -> None:
        """Hold a prop from now on, at rest; `set_palm` moves it to the palm.

        Args:
            prop: Any prop that is not held.
            yaw_rad: Heading of the walker.
        """
        yaw = prop.yaw_rad
        prop.carry(prop.position, yaw, (0.0, 0.0, 0.0))  # upright, as it is measured and held
        self._half_width_m = self._measured_half_width_m(prop, yaw_rad)
        self._below_m = float(prop.mass_centre[2]) - prop.lowest_m
        self._yaw_rad = yaw - yaw_rad
        self._velocity, self._turn_radps = np.zeros(3), 0.0
        self.grip.take(prop)

    def drop(self) -> None:
        """Hold nothing from now on; nothing is moved."""
        self.grip.drop()

    def collect_obstacles(self, ground: Floats, distance_m: float) -> None:
        """Collect what the held prop can reach within this agent step.

        Args:
            ground: ``(2,)`` metres: the walker's place on the floor.
            distance_m: The distance that the walker covers without obstacles.
        """
        if self.prop is not None:
            reach_m = _ARM_M + 2.0 * self.prop.extent_m + distance_m
            self._obstacles = self._capsule.solid_near(ground, reach_m)

    def set_palm(self, palm: Floats, ground: Floats, yaw_rad: float) -> None:
        """Move the held prop to the present pose of the palm; its velocity stays as it is.

        Args:
            palm: ``(3,)`` metres, world frame: centre of the right palm, which faces to the left.
            ground: ``(2,)`` metres: the walker's place on the floor.
            yaw_rad: Its heading.
        """
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y = palm[0] - ground[0], palm[1] - ground[1]
        left = self._half_width_m - _COMPRESSION_M
        height = max(float(palm[2]), self._below_m + _FLOOR_GAP_M)
        self._offset = np.array([c * x + s * y, c * y - s * x + left, height])
        if self.prop is not None:
            self._place(self.prop, ground, yaw_rad)
            self._set_velocity(self.prop)

    def follow(
        self,
        ground: Floats,
        yaw_rad: float,
        speed_mps: float,
        turn_radps: float,
        substep_s: float,
    ) -> None:
        """Move the held prop with the walker by one physics step.

        Args:
            ground: ``(2,)`` metres: the walker's place on the floor.
            yaw_rad: Its heading.
            speed_mps: Its commanded speed.
            turn_radps: Its turning speed.
            substep_s: Seconds since the last call.
        """
        if self.prop is not None:
            before, (start, start_rad) = self._centre, self._trunk
            self._place(self.prop, ground, yaw_rad)
            # where it would be if it had kept its place beside the trunk
            turn = rotation_about_vertical(yaw_rad - start_rad)
            carried = turn @ (before - _on_floor(start)) + _on_floor(ground)
            by_arm = _limited((self._centre - carried) / substep_s, _ARM_MPS)
            walking_mps = abs(speed_mps) + abs(turn_radps) * _ARM_M
            by_trunk = _limited((carried - before) / substep_s, walking_mps + _SHOVED_MPS)
            self._velocity = by_trunk + by_arm
            self._turn_radps = turn_radps
            self._set_velocity(self.prop)

    def _place(self, prop: Prop, ground: Floats, yaw_rad: float) -> None:
        """Hold the prop beside the palm, or as near to it as walls allow."""
        centre = self._reachable(prop, ground, yaw_rad)
        self._carry(prop, centre, yaw_rad)
        holder = np.array([ground[0], ground[1], centre[2]])
        for _ in range(_ROUNDS if self._obstacles else 0):
            out = way_out(self._client, prop.body_id, self._obstacles, holder)
            if not out.any():
                break
            centre = centre + out
            self._carry(prop, centre, yaw_rad)
        self._centre, self._trunk = centre, (ground.copy(), yaw_rad)

    def _carry(self, prop: Prop, centre: Floats, yaw_rad: float) -> None:
        """Set the pose of the prop by the place ``(3,)`` of its centre of mass."""
        yaw = yaw_rad + self._yaw_rad
        place = centre - rotation_about_vertical(yaw) @ prop.centre_of_mass
        self.grip.carry(place, yaw)

    def _set_velocity(self, prop: Prop) -> None:
        """Give the prop the velocities of the last physics step."""
        prop.set_velocity(self._velocity, (0.0, 0.0, self._turn_radps))

    def _reachable(self, prop: Prop, ground: Floats, yaw_rad: float) -> Floats:
        """Return the place of the prop, its centre on the walker's side of all that is solid."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y, height = self._offset
        distance_m = math.hypot(x, y)
        way = np.array([(c * x - s * y) / distance_m, (s * x + c * y) / distance_m, 0.0])
        axis = np.array([ground[0], ground[1], height])
        start_m = self._radius_m + _CLEARANCE_M
        clearance_m = self._half_width_m + _WALL_GAP_M
        start, end = (axis + metres * way for metres in (start_m, max(distance_m, start_m + 1e-3)))
        free_m = free_path_m(self._client, start, end, clearance_m, prop.body_id)
        return axis + min(distance_m, start_m + free_m) * way

    def _measured_half_width_m(self, prop: Prop, yaw_rad: float) -> float:
        """Return the distance from the prop's centre of mass to its surface on the right."""
        right = np.array([math.sin(yaw_rad), -math.cos(yaw_rad), 0.0])
        centre, reach_m = prop.mass_centre, 2.0 * prop.extent_m
        outside_m = surface_m(self._client, prop.body_id, centre + reach_m * right, centre)
        return reach_m - outside_m


def _on_floor(ground: Floats) -> Floats:
    """Return a place ``(3,)`` on the floor from its coordinates ``(2,)``, metres."""
    return np.array([ground[0], ground[1], 0.0])


def _limited(velocity: Floats, greatest_mps: float) -> Floats:
    """Return a velocity ``(3,)``, shortened to a speed."""
    speed = float(np.linalg.norm(velocity))
    return velocity if speed <= greatest_mps else velocity * (greatest_mps / speed)


class ObjectHandling:
    """The right hand and the kicking foot of one walker.

    Args:
        client: The PyBullet client.
        name: Name of the walker.
        cfg: Its parameters.
        motion: Its motion; a held prop follows it.
        gait: Its gait, which shows kicks and the arm that holds a prop.
    """

    def __init__(
        self, client: BulletClient, name: str, cfg: WalkerCfg, motion: GroundMotion, gait: Gait
    ) -> None:
        self._client, self._cfg = client, cfg
        self._motion, self._gait = motion, gait
        self._hand = Hand(client, name, motion.capsule, cfg.radius_m)

    @property
    def held(self) -> Prop | None:
        """The prop in the hand; None if the hand is empty."""
        return self._hand.prop

    @property
    def grip(self) -> Grip:
        """What holds the prop in the hand."""
        return self._hand.grip

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

"""The two stances of a walker, upright and on hands and knees, and the poses of its bones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton, Soles, forward_kinematics
from veca_marl.sim.body.anatomy.kinematics import Underside
from veca_marl.sim.body.walker.capsule import Capsule, lying_capsule, upright_capsule
from veca_marl.sim.body.walker.gait import Gait, clip
from veca_marl.sim.body.walker.neck import Neck
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.geometry import Floats, SceneObject
from veca_marl.sim.physics import World
from veca_marl.sim.physics.interactions import Crawl

_HALVINGS = 30  # of an interval of angles, down to rounding


class Stance(Protocol):
    """Pose and collision capsule of a walker.

    Attributes:
        capsule: Its capsule in the physics.
        speed_share: Speeds of full actions as fractions of those in walking.
        underside: The bones that touch the surface.
        hands_are_free: Whether it can hold, kick and step.
        pitch_range_rad: Range of the head's pitch without a turn; down is positive.
    """

    capsule: Capsule
    speed_share: float
    underside: Underside
    hands_are_free: bool
    pitch_range_rad: tuple[float, float]

    def turn(self, yaw_rad: float) -> None:
        """Turn the capsule to a heading."""
        ...

    def pelvis(self, ground: Floats, yaw_rad: float) -> tuple[Floats, Floats]:
        """Return position ``(3,)``, at height 0, and rotation ``(3, 3)`` of the pelvis."""
        ...

    def angles(self, head_pitch_rad: float, head_yaw_rad: float) -> Floats:
        """Return the ``(82,)`` joint angles at the present phase of the gait."""
        ...

    def head_reaches(self, pitch_rad: float, yaw_rad: float) -> bool:
        """Return whether the joints of the neck allow a pitch and a yaw of the head."""
        ...


class Upright:
    """Walks on two legs; see `Stance`.

    Args:
        skeleton: The table of bones and joints.
        gait: Gives the angles.
        capsule: An upright one.
    """

    speed_share = 1.0
    hands_are_free = True

    def __init__(self, skeleton: Skeleton, gait: Gait, capsule: Capsule) -> None:
        self.capsule = capsule
        self.underside: Underside = Soles(skeleton)
        self._gait, self._neck = gait, Neck(skeleton)
        self.pitch_range_rad = self._neck.pitch_range_rad

    def turn(self, yaw_rad: float) -> None:
        """See `Stance`; an upright capsule is round."""

    def pelvis(self, ground: Floats, yaw_rad: float) -> tuple[Floats, Floats]:
        """See `Stance`."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        rotation = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        return np.array((ground[0], ground[1], 0.0)), rotation

    def angles(self, head_pitch_rad: float, head_yaw_rad: float) -> Floats:
        """See `Stance`."""
        return self._gait.pose(head_pitch_rad, head_yaw_rad)

    def head_reaches(self, pitch_rad: float, yaw_rad: float) -> bool:
        """See `Stance`."""
        return self._neck.reaches(pitch_rad, yaw_rad, level_rad=0.0)


@dataclass(frozen=True)
class CrawlPose:
    """Parameters of crawling. The values are ours, chosen by eye.

    Attributes:
        pitch_deg: Pitch of the pelvis.
        pelvis_back_m: Distance of the pelvis behind the middle of the body, of the body of 0.78 m.
        neck_deg: Extension of neck and head together with which the eyes look ahead.
        swing_deg: Amplitude of arms and thighs at full stride.
    """

    pitch_deg: float = 85.0
    pelvis_back_m: float = 0.12
    neck_deg: float = 75.0
    swing_deg: float = 20.0

    joints_deg: ClassVar[dict[tuple[str, str], float]] = {
        ("thigh", "flexion"): 90.0,
        ("shank", "flexion"): 95.0,
        ("foot", "dorsiflexion"): -50.0,
        ("upper_arm", "flexion"): 85.0,
        ("hand", "flexion"): -75.0,
    }


class OnAllFours:
    """Crawls on hands and knees, diagonal limbs together; see `Stance`.

    Args:
        skeleton: The table of bones and joints.
        gait: Gives the phase of the stride.
        capsule: A lying one.
        speed_share: See `Stance`.
        pose: Parameters.
    """

    hands_are_free = False

    def __init__(
        self,
        skeleton: Skeleton,
        gait: Gait,
        capsule: Capsule,
        speed_share: float,
        pose: CrawlPose | None = None,
    ) -> None:
        self.capsule, self.speed_share = capsule, speed_share
        limbs = [f"{side}_{bone}" for side in "lr" for bone in ("hand", "shank", "foot")]
        self.underside = Underside(skeleton, limbs, skin=False)
        self._gait, self._pose = gait, pose or CrawlPose()
        self._low = np.array([joint.low_rad for joint in skeleton.joints])
        self._high = np.array([joint.high_rad for joint in skeleton.joints])
        self._rest = _resting_angles(skeleton, self._pose)
        self._diagonals = [
            [
                skeleton.joint(f"{leg}_thigh", "flexion"),
                skeleton.joint(f"{arm}_upper_arm", "flexion"),
            ]
            for leg, arm in ("lr", "rl")
        ]
        self._neck = Neck(skeleton)
        low_rad, high_rad = self._neck.pitch_range_rad
        extended_rad = self._extended_rad = math.radians(self._pose.neck_deg)
        self.pitch_range_rad = low_rad + extended_rad, high_rad + extended_rad
        self._back_m = self._pose.pelvis_back_m * skeleton.growth.size
        self._level_rad = -math.radians(self._pose.pitch_deg)

    def turn(self, yaw_rad: float) -> None:
        """See `Stance`."""
        self.capsule.yaw_rad = yaw_rad

    def pelvis(self, ground: Floats, yaw_rad: float) -> tuple[Floats, Floats]:
        """See `Stance`."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        pitch = math.radians(self._pose.pitch_deg)
        cp, sp = math.cos(pitch), math.sin(pitch)
        back = self._back_m
        rotation = np.array([[c * cp, -s, c * sp], [s * cp, c, s * sp], [-sp, 0.0, cp]])
        return np.array([ground[0] - back * c, ground[1] - back * s, 0.0]), rotation

    def angles(self, head_pitch_rad: float, head_yaw_rad: float) -> Floats:
        """See `Stance`."""
        angles = self._rest.copy()
        swing = math.radians(self._pose.swing_deg) * self._gait.share
        swing *= math.sin(2.0 * math.pi * self._gait.phase)
        for joints, sign in zip(self._diagonals, (1.0, -1.0), strict=True):
            angles[joints] += sign * swing
        pitch_rad = head_pitch_rad - self._extended_rad
        self._neck.turn(angles, pitch_rad, head_yaw_rad, self._level_rad)
        clip(angles, self._low, self._high)
        return angles

    def head_reaches(self, pitch_rad: float, yaw_rad: float) -> bool:
        """See `Stance`."""
        return self._neck.reaches(pitch_rad - self._extended_rad, yaw_rad, self._level_rad)


def _resting_angles(skeleton: Skeleton, pose: CrawlPose) -> Floats:
    """Return the joint angles ``(J,)`` in rad of crawling without the swing of the limbs."""
    angles = np.zeros(len(skeleton.joints))
    for (bone, label), degrees in pose.joints_deg.items():
        for side in "lr":
            angles[skeleton.joint(f"{side}_{bone}", label)] = math.radians(degrees)
    return angles


def make_stances(
    skeleton: Skeleton, gait: Gait, cfg: WalkerCfg, world: World
) -> tuple[Stance, Stance | None]:
    """Return the upright stance, and that on all fours if the verbs of the walker name `crawl`.

    Args:
        skeleton: The table of bones and joints.
        gait: The gait of the walker.
        cfg: Its parameters.
        world: The world.
    """
    upright = upright_capsule(
        world, cfg.radius_m, cfg.capsule_height_m, cfg.push_limit_kg, cfg.restitution
    )
    standing = Upright(skeleton, gait, upright)
    if Crawl.name not in cfg.verbs:
        return standing, None
    lying = lying_capsule(
        world, cfg.crawl_height_m, cfg.crawl_length_m, cfg.push_limit_kg, cfg.restitution
    )
    return standing, OnAllFours(skeleton, gait, lying, cfg.crawl_share)


class BonePoses:
    """Writes the poses of the 47 bones of a walker into the scene.

    Args:
        skeleton: The table of bones and joints.
        bones: The object of the scene with a frame for each bone.
    """

    def __init__(self, skeleton: Skeleton, bones: SceneObject) -> None:
        self._skeleton, self._bones = skeleton, bones
        self._yaw_range_rad = Neck(skeleton).yaw_range_rad
        self._head_pitch_rad = self._head_yaw_rad = 0.0

    def reset(self, head_pitch_rad: float) -> None:
        """Look straight ahead with a pitch of the head; down is positive."""
        self._head_pitch_rad, self._head_yaw_rad = head_pitch_rad, 0.0

    def pitch_head(self, deg: float, stance: Stance) -> None:
        """Nod down by an angle about the head's own axis, clipped to its range in a stance.

        Raises:
            ValueError: If the angle is not finite.
        """
        pitch_rad, yaw_rad = self._head_in(stance)
        aim_rad = _clipped(pitch_rad + _finite_rad(deg), stance.pitch_range_rad)
        reached_rad = _farthest(pitch_rad, aim_rad, lambda p: stance.head_reaches(p, yaw_rad))
        self._head_pitch_rad, self._head_yaw_rad = reached_rad, yaw_rad

    def yaw_head(self, deg: float, stance: Stance) -> None:
        """Turn the head to the left by an angle, clipped to its range in a stance.

        Raises:
            ValueError: If the angle is not finite.
        """
        pitch_rad, yaw_rad = self._head_in(stance)
        aim_rad = _clipped(yaw_rad + _finite_rad(deg), self._yaw_range_rad)
        reached_rad = _farthest(yaw_rad, aim_rad, lambda y: stance.head_reaches(pitch_rad, y))
        self._head_yaw_rad = reached_rad

    def _head_in(self, stance: Stance) -> tuple[float, float]:
        """Return the nearest pitch and, at that pitch, yaw of the head that a stance allows."""
        pitch_rad = _clipped(self._head_pitch_rad, stance.pitch_range_rad)
        if self._head_yaw_rad == 0.0:
            return pitch_rad, 0.0
        yaw_rad = _farthest(0.0, self._head_yaw_rad, lambda y: stance.head_reaches(pitch_rad, y))
        return pitch_rad, yaw_rad

    def write(self, stance: Stance, ground: Floats, yaw_rad: float, surface_m: float) -> Floats:
        """Compute all bone poses, shifted vertically until the body touches the surface.

        Args:
            stance: The present stance.
            ground: ``(2,)`` metres, position on the floor plan.
            yaw_rad: Heading.
            surface_m: Height of the surface under the walker.

        Returns:
            The joint angles, ``(82,)`` rad; the array belongs to the stance.
        """
        positions, rotations = self._bones.positions, self._bones.rotations
        positions[0], rotations[0] = stance.pelvis(ground, yaw_rad)
        angles = stance.angles(*self._head_in(stance))
        forward_kinematics(self._skeleton, angles, positions, rotations)
        stance.underside.put_on(surface_m, positions, rotations)
        return angles


def _finite_rad(deg: float) -> float:
    """Return an angle in radians; raise `ValueError` if it is not finite."""
    if not math.isfinite(deg):
        raise ValueError(f"cannot turn the head by {deg} degrees")
    return math.radians(deg)


def _clipped(angle_rad: float, range_rad: tuple[float, float]) -> float:
    low, high = range_rad
    return min(max(angle_rad, low), high)


def _farthest(start: float, end: float, is_possible: Callable[[float], bool]) -> float:
    """Return the end of an interval, or the last possible number from a possible start to it."""
    if is_possible(end):
        return end
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + end)
        start, end = (middle, end) if is_possible(middle) else (start, middle)
    return start

"""Motion of both palms of a sitting body, as a pair with a common middle and a distance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from veca_marl.envs.experts.control.arm_kinematics import ArmKinematics, Palms
from veca_marl.envs.experts.control.seated_balance import SeatedBalance
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import REACHING, REACHING_DOWN, Posture
from veca_marl.sim.geometry import Floats

_TRUNK = ("spine", "chest")
_TWIST = ("lateral", "rotation")
_SHARE_PER_S = 3.75  # of the difference: a time constant of 0.27 s


class TrunkTwist:
    """Joint angles of a body with filtered lateral flexion and rotation of its trunk.

    Arms that follow the twist of the trunk without a filter accelerate against it with a delay of
    one agent step. Their reaction amplifies the twist: trunk and palms oscillate at 2.4 Hz, the
    palms by 20 mm to either side. With the filter the amplitude is 2 mm.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._share = body, min(1.0, _SHARE_PER_S * step_s)
        names = body.joint_names
        self._joints = [names.index(f"{bone}.{twist}") for bone in _TRUNK for twist in _TWIST]
        self.reset()

    def reset(self) -> None:
        """Start from the present joint angles."""
        self._filtered = self._body.joint_angles()[self._joints]

    def filtered_angles(self) -> Floats:
        """Return joint angles ``(82,)`` rad, those of the twist filtered. One call per step."""
        angles = self._body.joint_angles()
        self._filtered = self._filtered + self._share * (angles[self._joints] - self._filtered)
        angles[self._joints] = self._filtered
        return angles


_SPEED_MPS = 0.25  # largest speed of the middle between the palms in each direction
_CLOSING_MPS = 0.15  # largest change of the distance between the palms
FINGER_PITCH_RAD = math.radians(20.0)  # downwards, unless a cube is levelled
_UP = np.array([0.0, 0.0, 1.0])
_SIDES = np.array([1.0, -1.0])
# Of the inverse kinematics. An arm that is pulled back from near full extension needs fast changes
# of its joints; where they are limited more, or directions weigh more, the hand sinks by 60 mm.
_MAX_CHANGE_RADPS, _DIRECTION_M = 6.25, 0.03
_INTEGRAL_GAIN_PER_S, _MAX_INTEGRAL_M = 0.75, 0.02
_ARRIVED_M = 0.008
_HIGH_M, _LOW_M = 0.10, 0.04  # heights of the palms at which the body sits upright and bent
_BENDING_PER_S = 2.5  # largest change of the bend; faster, the palms rise or sink by 40 mm


class Grip(NamedTuple):
    """Target poses of both palms, on opposite sides of a point.

    Attributes:
        centre: Middle between the palms, ``(3,)`` metres.
        gap_m: Distance between the palms.
        yaw_rad: Yaw of the line between them; at 0 the left palm is at +y.
        pitch_rad: Pitch of the fingers, downwards from the horizontal.
    """

    centre: Floats
    gap_m: float
    yaw_rad: float = 0.0
    pitch_rad: float = FINGER_PITCH_RAD


class PalmMotion:
    """Controller of both hands of a body that sits at the origin and faces +x.

    Args:
        body: The body.
        step_s: Duration of an environment step.
        upright: Posture while the hands are up.
        bent: Posture while the hands are down.
        posture_gain_per_s: Integral gain of the trunk, see `SeatedBalance`.
    """

    def __init__(
        self,
        body: Humanoid,
        step_s: float,
        upright: Posture = REACHING,
        bent: Posture = REACHING_DOWN,
        posture_gain_per_s: float = 0.75,
    ) -> None:
        self._step_s = step_s
        self._hands = ArmKinematics(body, _MAX_CHANGE_RADPS * step_s, _DIRECTION_M)
        self._twist = TrunkTwist(body, step_s)
        self._seat = SeatedBalance(body, step_s, upright, bent, posture_gain_per_s)
        self.reset()

    def reset(self) -> None:
        """Start from the present pose of the palms, with the trunk upright."""
        self._seat.reset()
        self._twist.reset()
        self._targets = self._seat.upright.copy()
        self._integral = np.zeros(3)
        self._held: Grip | None = None
        self._bend = 0.0

    @property
    def middle(self) -> Floats:
        """The point between the palms, ``(3,)`` metres."""
        middle: Floats = self._hands.palms().points.mean(axis=0)
        return middle

    @property
    def gap_m(self) -> float:
        """The distance between the palms."""
        left, right = self._hands.palms().points
        return math.dist(left, right)

    def steps(self, seconds: float) -> int:
        """Return the number of steps of a duration, at least 1."""
        return max(1, round(seconds / self._step_s))

    def share(self, per_s: float) -> float:
        """Return the change in one step of what changes by ``per_s`` per second."""
        return per_s * self._step_s

    def move(self, goal: Grip, speed_mps: float = _SPEED_MPS) -> Floats:
        """Return target angles ``(82,)`` rad of a motion toward a grip. One call per step.

        Args:
            goal: The grip to move to.
            speed_mps: Largest speed of the middle between the palms in each direction.
        """
        way_m, closing_m = speed_mps * self._step_s, _CLOSING_MPS * self._step_s
        held = self._held or Grip(self.middle, self.gap_m)
        centre = held.centre + np.clip(goal.centre - held.centre, -way_m, way_m)
        gap = held.gap_m + float(np.clip(goal.gap_m - held.gap_m, -closing_m, closing_m))
        self._held = Grip(centre, gap, goal.yaw_rad, goal.pitch_rad)
        wanted = self._corrected(_palms(self._held))
        trunk = self._twist.filtered_angles()
        self._targets = self._hands.reach(self._targets, wanted, iterations=3, trunk=trunk)
        return self._seat.hold(self._targets, self._bend_toward(centre[2]))

    def is_at(self, goal: Grip) -> bool:
        """Return whether the middle between the palms has reached that of a grip."""
        return bool(np.abs(self.middle - goal.centre).max() < _ARRIVED_M)

    def until_at(
        self, goal: Callable[[], Grip], most_s: float, settled_s: float = 0.0
    ) -> Iterator[Floats]:
        """Yield target angles until the palms are at the goal.

        Args:
            goal: Returns the grip to move to.
            most_s: Longest duration.
            settled_s: Time for which they have to be there without a break; at least one step.
        """
        there, settled = 0, self.steps(settled_s)
        for _ in range(self.steps(most_s)):
            yield self.move(goal())
            there = there + 1 if self.is_at(goal()) else 0
            if there == settled:
                return

    def during(self, goal: Grip, seconds: float) -> Iterator[Floats]:
        """Yield target angles of a motion toward a grip for some time."""
        for _ in range(self.steps(seconds)):
            yield self.move(goal)

    def _corrected(self, palms: Palms) -> Palms:
        """Return palm poses shifted by an integral of the error of the middle between them.

        There is no correction of the distance between them: its compliance sets the grip force.
        """
        error = (palms.points - self._hands.palms().points).mean(axis=0)
        change = _INTEGRAL_GAIN_PER_S * self._step_s * error
        self._integral = np.clip(self._integral + change, -_MAX_INTEGRAL_M, _MAX_INTEGRAL_M)
        return palms._replace(points=palms.points + self._integral)

    def _bend_toward(self, height_m: float) -> float:
        """Return the bend of the trunk, in [0, 1], on its way to that for a height of the palms."""
        goal = min(max((_HIGH_M - height_m) / (_HIGH_M - _LOW_M), 0.0), 1.0)
        most = _BENDING_PER_S * self._step_s
        self._bend += min(max(goal - self._bend, -most), most)
        return self._bend


def _palms(grip: Grip) -> Palms:
    """Return the palm poses of a grip; the fingers point ahead and down."""
    c, s = math.cos(grip.yaw_rad), math.sin(grip.yaw_rad)
    across, ahead = np.array([-s, c, 0.0]), np.array([c, s, 0.0])
    fingers = math.cos(grip.pitch_rad) * ahead - math.sin(grip.pitch_rad) * _UP
    return Palms(
        points=grip.centre + np.outer(_SIDES, across) * grip.gap_m / 2,
        normals=-np.outer(_SIDES, across),
        fingers=np.stack([fingers, fingers]),
    )

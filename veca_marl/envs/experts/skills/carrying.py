"""Carrying a block between both palms, as a sequence of grips."""

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
from veca_marl.sim.physics import Prop

_SPEED_M = 0.010  # largest motion of the middle between the palms, per step
_CLOSING_M = 0.006  # largest change of the distance between the palms, per step
_FINGER_PITCH_RAD = math.radians(20.0)  # downwards
_UP = np.array([0.0, 0.0, 1.0])
_RETREAT = 0.10 * _UP  # the hands leave a block upwards by this distance
_SIDES = np.array([1.0, -1.0])
_INTEGRAL_GAIN, _MAX_INTEGRAL_M = 0.03, 0.02
_ARRIVED_M = 0.008
# how near a carried block has to come to its target: lifted, above the goal, and before release
_LIFTED_M, _ABOVE_M, _PLACED_M = 0.02, 0.007, 0.005
_LIFT_STEPS, _TRANSFER_STEPS, _LOWER_STEPS = 75, 110, 75
_HIGH_M, _LOW_M = 0.10, 0.04  # heights of the palms at which the body sits upright and bent


class Grip(NamedTuple):
    """Target poses of both palms, on opposite sides of a point.

    Attributes:
        centre: Middle between the palms, ``(3,)`` metres.
        gap_m: Distance between the palms.
        yaw_rad: Yaw of the line between them; at 0 the left palm is at +y.
    """

    centre: Floats
    gap_m: float
    yaw_rad: float = 0.0


# resting place of the hands, beside the legs: the trunk turns slowly by up to 20 degrees while it
# sits, and the hands must not touch what has been piled up
_HOME = Grip(np.array([0.10, 0.0, 0.14]), 0.50)


class Carrier:
    """Controller of both hands of a body that sits at the origin and faces +x.

    Args:
        body: The body.
        squeeze_m: Each palm's target is this far inside the block, which sets the grip force.
        carrying_m: Motion of a carried block per step.
        thumbs_m: Height of the palms above the middle of a block, so that thumbs clear its top.
        clear_m: Distance between each open palm and the block.
        upright: Posture while the hands are up.
        bent: Posture while the hands are down.
        posture_gain: Integral gain of the trunk, see `SeatedBalance`; a small one lets the trunk
            follow slowly, a large one makes it oscillate while the hands are high.
    """

    def __init__(
        self,
        body: Humanoid,
        squeeze_m: float = 0.02,
        carrying_m: float = 0.006,
        thumbs_m: float = 0.008,
        clear_m: float = 0.022,
        upright: Posture = REACHING,
        bent: Posture = REACHING_DOWN,
        posture_gain: float = 0.03,
    ) -> None:
        self._hands = ArmKinematics(body)
        self._seat = SeatedBalance(body, upright, bent, posture_gain)
        self._squeeze_m, self._clear_m = squeeze_m, clear_m
        self._carrying_m, self._thumbs = carrying_m, thumbs_m * _UP
        self.reset()

    def reset(self) -> None:
        """Start from the present pose of the palms."""
        self._seat.reset()
        self._targets = self._seat.upright.copy()
        self._integral = np.zeros((2, 3))
        self._held: Grip | None = None

    def move(self, goal: Grip, speed_m: float = _SPEED_M) -> Floats:
        """Return target angles ``(82,)`` rad of a motion toward a grip. One call per step.

        Args:
            goal: The grip to move to.
            speed_m: Largest motion of the middle between the palms.
        """
        points = self._hands.palms().points
        held = self._held or Grip(points.mean(axis=0), float(np.linalg.norm(points[0] - points[1])))
        centre = held.centre + np.clip(goal.centre - held.centre, -speed_m, speed_m)
        gap = held.gap_m + float(np.clip(goal.gap_m - held.gap_m, -_CLOSING_M, _CLOSING_M))
        self._held = Grip(centre, gap, goal.yaw_rad)
        wanted = _palms(self._held)
        error = wanted.points - points
        error[:] = error.mean(axis=0)  # none for the gap: its compliance sets the grip force
        self._integral = np.clip(
            self._integral + _INTEGRAL_GAIN * error, -_MAX_INTEGRAL_M, _MAX_INTEGRAL_M
        )
        wanted = wanted._replace(points=wanted.points + self._integral)
        self._targets = self._hands.reach(self._targets, wanted, iterations=3)
        bend = float(np.clip((_HIGH_M - centre[2]) / (_HIGH_M - _LOW_M), 0.0, 1.0))
        return self._seat.hold(self._targets, bend)

    def is_at(self, goal: Grip) -> bool:
        """Return whether the middle between the palms has reached that of a grip."""
        middle = self._hands.palms().points.mean(axis=0)
        return bool(np.abs(middle - goal.centre).max() < _ARRIVED_M)

    def carry(
        self, block: Prop, to: Callable[[], Floats], over_m: float, above_m: float = 0.1
    ) -> Iterator[Floats]:
        """Yield target angles, one array per step: grip a block, put it down, release it.

        Args:
            block: A cube.
            to: Returns the target of its centre, ``(3,)`` metres.
            over_m: Height of the block's centre while it is carried.
            above_m: Height above the block from which the hands approach.
        """
        edge = block.cfg.size_m[0]
        wide, tight = edge + 2 * self._clear_m, edge - 2 * self._squeeze_m
        yaw = quarter_yaw(block)
        start = self._hands.palms().points.mean(axis=0)
        above = above_m * _UP
        high = start * (1, 1, 0) + (block.position + above) * (0, 0, 1)
        yield from self._until(lambda: Grip(high, wide, yaw), 20)
        yield from self._until(lambda: Grip(block.position + above, wide, yaw), 50)
        yield from self._until(lambda: Grip(block.position + self._thumbs, wide, yaw), 40)
        yield from self._for(Grip(block.position + self._thumbs, tight, yaw), 16)
        lifted = block.position * (1, 1, 0) + over_m * _UP
        for place, near_m, steps in (
            (lambda: lifted, _LIFTED_M, _LIFT_STEPS),
            (lambda: to() * (1, 1, 0) + over_m * _UP, _ABOVE_M, _TRANSFER_STEPS),
            (to, _PLACED_M, _LOWER_STEPS),
        ):
            held = Grip(block.position, tight, yaw)
            yield from self._bring(block, place, held, near_m, steps)
            if not self._holds(block):
                break
        here = self._hands.palms().points.mean(axis=0)
        wide += 2 * self._clear_m
        yield from self._for(Grip(here, wide, yaw), 16)
        yield from self._until(lambda: Grip(here + _RETREAT, wide, yaw), 30)

    def rest(self) -> Iterator[Floats]:
        """Yield target angles, endlessly: move the hands around objects to their resting place.

        They move back before they open: beside an object that was put down others may stand.
        """
        points = self._hands.palms().points
        middle, gap = points.mean(axis=0), float(np.linalg.norm(points[0] - points[1]))
        back = middle * (0, 1, 1) + _HOME.centre * (1, 0, 0)
        yield from self._until(lambda: Grip(back, gap), 25)
        yield from self._for(Grip(back, _HOME.gap_m), 15)
        while True:
            yield self.move(_HOME)

    def _holds(self, block: Prop) -> bool:
        off = self._hands.palms().points.mean(axis=0) - block.position
        return bool(np.abs(off).max() < block.cfg.size_m[0] / 2)

    def _until(self, goal: Callable[[], Grip], steps: int) -> Iterator[Floats]:
        """Move until the palms have reached the goal, at most for a number of steps."""
        for _ in range(steps):
            yield self.move(goal())
            if self.is_at(goal()):
                return

    def _for(self, goal: Grip, steps: int) -> Iterator[Floats]:
        for _ in range(steps):
            yield self.move(goal)

    def _bring(
        self, block: Prop, to: Callable[[], Floats], grip: Grip, near_m: float, steps: int
    ) -> Iterator[Floats]:
        """Move the palms until the block between them is near its target."""
        for _ in range(steps):
            if not self._holds(block) or np.abs(to() - block.position).max() < near_m:
                return
            slip = self._hands.palms().points.mean(axis=0) - block.position
            yield self.move(grip._replace(centre=to() + slip), self._carrying_m)


def _palms(grip: Grip) -> Palms:
    """Return the palm poses of a grip; the fingers point ahead and down."""
    c, s = math.cos(grip.yaw_rad), math.sin(grip.yaw_rad)
    across, ahead = np.array([-s, c, 0.0]), np.array([c, s, 0.0])
    fingers = math.cos(_FINGER_PITCH_RAD) * ahead - math.sin(_FINGER_PITCH_RAD) * _UP
    return Palms(
        points=grip.centre + np.outer(_SIDES, across) * grip.gap_m / 2,
        normals=-np.outer(_SIDES, across),
        fingers=np.stack([fingers, fingers]),
    )


def quarter_yaw(cube: Prop) -> float:
    """Return the yaw of a cube modulo a quarter turn, in [-pi/4, pi/4) rad."""
    yaw = math.atan2(cube.rotation[1, 0], cube.rotation[0, 0])
    return (yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4

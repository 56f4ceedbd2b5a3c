"""Taking a block between both palms and putting it somewhere else, as a script of grips."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from veca_marl.envs.experts.control.arm_kinematics import ArmKinematics, Palms
from veca_marl.envs.experts.control.seated_balance import SeatedBalance
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import REACHING, REACHING_DOWN, Posture
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import Prop

_SPEED_M = 0.010  # of the palms' middle, per step
_CLOSING_M = 0.006  # of their distance, per step
_DROOP = math.radians(20.0)  # the fingers point down by so much
_UP = np.array([0.0, 0.0, 1.0])
_ABOVE = 0.10 * _UP  # the hands come and go so far above a block
_SIDES = np.array([1.0, -1.0])
_SAG_GAIN, _MOST_SAG_M = 0.03, 0.02
_NEAR_M = 0.008
_HIGH_M, _LOW_M = 0.10, 0.04  # heights of the palms for which it sits upright, and bends down


class Grip(NamedTuple):
    """Where the palms shall be: on both sides of a point.

    Attributes:
        centre: ``(3,)`` metres.
        gap_m: Distance of the palms.
        yaw_rad: Turn of the line between them about the vertical; 0 has the left palm at +y.
    """

    centre: Floats
    gap_m: float
    yaw_rad: float = 0.0


# hands at rest, beside all that may be piled up; the child sits at the origin
_HOME = Grip(np.array([0.19, 0.0, 0.11]), 0.40)


class Carrier:
    """The hands of a child that sits at the origin and faces x.

    Args:
        body: Whose hands.
        squeeze_m: The palms press as if they wanted to come so far into the block, each.
        carrying_m: How far the block comes in a step.
        thumbs_m: Palms are so far above a block's middle: thumbs stay above its top.
        clear_m: Open palms are so far away from the block, each.
        upright: How it sits while the hands are up.
        bent: How it sits while they are down.
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
    ) -> None:
        self._hands, self._seat = ArmKinematics(body), SeatedBalance(body, upright, bent)
        self._squeeze_m, self._clear_m = squeeze_m, clear_m
        self._carrying_m, self._thumbs = carrying_m, thumbs_m * _UP
        self.reset()

    def reset(self) -> None:
        """Begin anew, from wherever the palms are."""
        self._seat.reset()
        self._wish = self._seat.upright.copy()
        self._sag = np.zeros((2, 3))
        self._held: Grip | None = None

    def move(self, goal: Grip, speed_m: float = _SPEED_M) -> Floats:
        """Return the joint angles ``(82,)`` of a step toward a grip. Call it once per step."""
        points = self._hands.palms().points
        held = self._held or Grip(points.mean(axis=0), float(np.linalg.norm(points[0] - points[1])))
        centre = held.centre + np.clip(goal.centre - held.centre, -speed_m, speed_m)
        gap = held.gap_m + float(np.clip(goal.gap_m - held.gap_m, -_CLOSING_M, _CLOSING_M))
        self._held = Grip(centre, gap, goal.yaw_rad)
        wanted = _palms(self._held)
        off = wanted.points - points
        off[:] = off.mean(axis=0)  # their distance stays springy: it is what holds the block
        self._sag = np.clip(self._sag + _SAG_GAIN * off, -_MOST_SAG_M, _MOST_SAG_M)
        wanted = wanted._replace(points=wanted.points + self._sag)
        self._wish = self._hands.reach(self._wish, wanted, iterations=3)
        bend = float(np.clip((_HIGH_M - centre[2]) / (_HIGH_M - _LOW_M), 0.0, 1.0))
        return self._seat.hold(self._wish, bend)

    def is_at(self, goal: Grip) -> bool:
        """Say whether the middle of the palms has come to that of a grip."""
        middle = self._hands.palms().points.mean(axis=0)
        return bool(np.abs(middle - goal.centre).max() < _NEAR_M)

    def carry(
        self, block: Prop, to: Callable[[], Floats], over_m: float, above_m: float = 0.1
    ) -> Iterator[Floats]:
        """Yield the wishes of taking a block, putting it down at a point and letting go.

        Args:
            block: A cube.
            to: Returns where its centre shall come to, ``(3,)`` metres.
            over_m: Height in which the block's centre travels.
            above_m: The hands come from so far above the block.
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
        for place in (lambda: lifted, lambda: to() * (1, 1, 0) + over_m * _UP, to):
            yield from self._bring(block, place, tight, yaw, 75)
            if not self._holds(block):
                break
        here = self._hands.palms().points.mean(axis=0)
        wide += 2 * self._clear_m
        yield from self._for(Grip(here, wide, yaw), 16)
        yield from self._until(lambda: Grip(here + _ABOVE, wide, yaw), 30)

    def rest(self) -> Iterator[Floats]:
        """Yield the wishes of bringing the hands home, round what lies about, for ever."""
        over = self._hands.palms().points.mean(axis=0)
        yield from self._for(Grip(over, _HOME.gap_m), 15)
        back = _HOME.centre * (1, 1, 0) + over * (0, 0, 1)
        yield from self._until(lambda: Grip(back, _HOME.gap_m), 25)
        while True:
            yield self.move(_HOME)

    def _holds(self, block: Prop) -> bool:
        off = self._hands.palms().points.mean(axis=0) - block.position
        return bool(np.abs(off).max() < block.cfg.size_m[0] / 2)

    def _until(self, goal: Callable[[], Grip], steps: int) -> Iterator[Floats]:
        """Move until the palms are there, or for so many steps."""
        for _ in range(steps):
            yield self.move(goal())
            if self.is_at(goal()):
                return

    def _for(self, goal: Grip, steps: int) -> Iterator[Floats]:
        for _ in range(steps):
            yield self.move(goal)

    def _bring(
        self, block: Prop, to: Callable[[], Floats], gap_m: float, yaw_rad: float, steps: int
    ) -> Iterator[Floats]:
        """Move the palms until the block between them is there."""
        for _ in range(steps):
            if not self._holds(block) or np.abs(to() - block.position).max() < 0.005:
                return
            slip = self._hands.palms().points.mean(axis=0) - block.position
            yield self.move(Grip(to() + slip, gap_m, yaw_rad), self._carrying_m)


def _palms(grip: Grip) -> Palms:
    c, s = math.cos(grip.yaw_rad), math.sin(grip.yaw_rad)
    across, ahead = np.array([-s, c, 0.0]), np.array([c, s, 0.0])
    fingers = math.cos(_DROOP) * ahead - math.sin(_DROOP) * np.array([0.0, 0.0, 1.0])
    return Palms(
        points=grip.centre + np.outer(_SIDES, across) * grip.gap_m / 2,
        normals=-np.outer(_SIDES, across),
        fingers=np.stack([fingers, fingers]),
    )


def quarter_yaw(cube: Prop) -> float:
    """Return a cube's turn about the vertical up to quarter turns, in [-pi/4, pi/4), rad."""
    yaw = math.atan2(cube.rotation[1, 0], cube.rotation[0, 0])
    return (yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4

"""Lifting and carrying a cube between both palms, as a sequence of grips."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import reaching
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop

_UP = np.array([0.0, 0.0, 1.0])
# time at the place before the hands close and after a cube is lifted: the trunk sways up and down,
# palms that close too high lose the cube, and one that sinks while it is moved hits others
_SETTLED_S = 0.2
_RETREAT = 0.10 * _UP  # the hands leave a cube upwards by this distance
# longest durations of the stages; the hands close for at least `_CLOSE_S`
_HIGH_S, _ABOVE_S, _DOWN_S = 0.8, 2.0, 1.6
_CLOSE_S, _MOST_CLOSE_S = 0.88, 1.44
_SKIN_M = 0.008  # the palms' distance from a cube between them with a light grip
_LIFT_S, _TRANSFER_S, _LOWER_S = 1.6, 4.4, 1.8
_OPEN_S, _RETREAT_S, _BACK_S, _SPREAD_S = 0.64, 1.2, 1.0, 0.6
# Largest errors of a lifted cube and of one that is put down. Only the height counts: a cube that
# is moved sideways before it is lifted drags the one below it.
_LIFTED_M, _PLACED_M = np.array([np.inf, np.inf, 0.012]), np.array([np.inf, np.inf, 0.004])
_PITCH_RAD = math.radians(-30.0), math.radians(60.0)  # of the fingers while a cube is levelled
# resting place of the hands, beside the legs: the trunk turns slowly by up to 20 degrees while it
# sits, and the hands must not touch what has been piled up
_HOME = Grip(np.array([0.10, 0.0, 0.14]), 0.50)


@dataclass(frozen=True)
class CarryCfg:
    """Numbers of carrying.

    Attributes:
        squeeze_m: Each palm's target is this far inside the cube, which sets the grip force.
        speed_mps: Largest speed of a carried cube in each direction.
        thumbs_m: Height of the palms above the middle of the cube, so that thumbs clear its top.
        clear_m: Distance between each open palm and the cube.
        above_m: Height above the cube from which the hands approach.
        over_m: Largest error above the target in each direction, metres, before the cube is
            lowered.
        levelling_per_s: Change of the fingers' pitch per second, as a share of the forward tilt of
            the cube.
    """

    squeeze_m: float = 0.02
    speed_mps: float = 0.15
    thumbs_m: float = 0.008
    clear_m: float = 0.022
    above_m: float = 0.1
    over_m: tuple[float, float, float] = (0.007, 0.007, 0.02)
    levelling_per_s: float = 0.0


class _Way(NamedTuple):
    """A motion of a carried cube.

    Attributes:
        to: Returns the target of its centre, ``(3,)`` metres.
        near_m: Largest error in each direction, ``(3,)`` metres.
        most_s: Longest duration.
        settled_s: Time for which the cube has to be at the target without a break; at least one
            step.
    """

    to: Callable[[], Floats]
    near_m: Floats
    most_s: float
    settled_s: float = 0.0


def carry(
    palms: PalmMotion, cube: Prop, to: Callable[[], Floats], height_m: float, cfg: CarryCfg
) -> Iterator[Floats]:
    """Yield target angles ``(82,)`` rad, one array per step: grip a cube, put it down, release it.

    A cube that is lost on the way is left where it is.

    Args:
        palms: Controller of the hands.
        cube: A cube.
        to: Returns the target of its centre, ``(3,)`` metres.
        height_m: Height of its centre while it is carried.
        cfg: Numbers.
    """
    yaw = quarter_yaw(cube)
    yield from _grip(palms, cube, yaw, cfg)
    tight = Grip(cube.position, cube.cfg.size_m[0] - 2 * cfg.squeeze_m, yaw)
    lifted = _at_height(cube.position, height_m)
    for way in (
        _Way(lambda: lifted, _LIFTED_M, _LIFT_S, _SETTLED_S),
        _Way(lambda: _at_height(to(), height_m), np.array(cfg.over_m), _TRANSFER_S),
        _Way(to, _PLACED_M, _LOWER_S),
    ):
        tight = yield from _bring(palms, cube, way, tight, cfg)
    wide_m = cube.cfg.size_m[0] + 4 * cfg.clear_m
    yield from _release(palms, tight._replace(centre=palms.middle, gap_m=wide_m))


def return_to_rest(palms: PalmMotion) -> Iterator[Floats]:
    """Yield target angles, endlessly: move the hands around objects to their resting place.

    They move back before they open: beside an object that was put down others may stand.
    """
    gap_m = palms.gap_m
    back = palms.middle * (0, 1, 1) + _HOME.centre * (1, 0, 0)
    yield from palms.until_at(lambda: Grip(back, gap_m), _BACK_S)
    yield from palms.during(Grip(back, _HOME.gap_m), _SPREAD_S)
    while True:
        yield palms.move(_HOME)


def quarter_yaw(cube: Prop) -> float:
    """Return the yaw of a cube modulo a quarter turn, in [-pi/4, pi/4) rad."""
    yaw = math.atan2(cube.rotation[1, 0], cube.rotation[0, 0])
    return (yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4


def _grip(palms: PalmMotion, cube: Prop, yaw: float, cfg: CarryCfg) -> Iterator[Floats]:
    """Move the open hands over a cube, then down beside it, and close them."""
    edge, above, thumbs = cube.cfg.size_m[0], cfg.above_m * _UP, cfg.thumbs_m * _UP
    wide, tight = edge + 2 * cfg.clear_m, edge - 2 * cfg.squeeze_m
    high = _at_height(palms.middle, cube.position[2] + cfg.above_m)
    yield from palms.until_at(lambda: Grip(high, wide, yaw), _HIGH_S)
    yield from palms.until_at(lambda: Grip(cube.position + above, wide, yaw), _ABOVE_S)
    yield from palms.until_at(lambda: Grip(cube.position + thumbs, wide, yaw), _DOWN_S, _SETTLED_S)
    yield from _close(palms, cube, Grip(cube.position + thumbs, tight, yaw))


def _close(palms: PalmMotion, cube: Prop, grip: Grip) -> Iterator[Floats]:
    """Close the hands until both press on the cube, which they push forwards."""
    place, touching_m = cube.position, cube.cfg.size_m[0] + _SKIN_M
    least = palms.steps(_CLOSE_S)
    for step in range(palms.steps(_MOST_CLOSE_S)):
        pushed = (cube.position - place) * (1, 0, 0)
        yield palms.move(grip._replace(centre=grip.centre - pushed))
        if step >= least and palms.gap_m < touching_m:
            return


def _bring(
    palms: PalmMotion, cube: Prop, way: _Way, grip: Grip, cfg: CarryCfg
) -> Generator[Floats, None, Grip]:
    """Move the palms until the cube between them is at its target, or lost; return the grip."""
    there, settled = 0, palms.steps(way.settled_s)
    levelling = palms.share(cfg.levelling_per_s)
    for _ in range(palms.steps(way.most_s)):
        slip = palms.middle - cube.position
        lost = np.abs(slip).max() >= cube.cfg.size_m[0] / 2
        there = there + 1 if (np.abs(way.to() - cube.position) < way.near_m).all() else 0
        if lost or there == settled:
            break
        level_rad = grip.pitch_rad - levelling * _forward_tilt_rad(cube, grip.yaw_rad)
        grip = grip._replace(
            centre=way.to() + slip, pitch_rad=float(np.clip(level_rad, *_PITCH_RAD))
        )
        yield palms.move(grip, cfg.speed_mps)
    return grip


def _forward_tilt_rad(cube: Prop, yaw_rad: float) -> float:
    """Return the angle by which the top of a cube leans toward a heading, modulo a quarter turn."""
    axes = cube.rotation.T
    up = axes[np.abs(axes[:, 2]).argmax()]
    up = up * math.copysign(1.0, up[2])
    return math.atan2(up[0] * math.cos(yaw_rad) + up[1] * math.sin(yaw_rad), up[2])


def _release(palms: PalmMotion, opened: Grip) -> Iterator[Floats]:
    """Open the hands, then raise them."""
    yield from palms.during(opened, _OPEN_S)
    raised = opened._replace(centre=opened.centre + _RETREAT)
    yield from palms.until_at(lambda: raised, _RETREAT_S)


def _at_height(point: Floats, height_m: float) -> Floats:
    """Return a point with another height."""
    return point * (1, 1, 0) + height_m * _UP


# less bent than for carrying, since the spine supports both extended arms for seconds
UPRIGHT, BENT = reaching(15.0, 20.0), reaching(30.0, 20.0)
_CLEARANCE_M = 0.022  # between each open palm and the cube
_SQUEEZE_M = 0.03  # each palm's target is this far inside the cube, which sets the grip force
_ABOVE = np.array([0.0, 0.0, 0.07])  # the hands approach from here
# The palms close in front of the centre and below it: they press the cube toward the body and
# slide up along it.
_GRIP_OFFSET = np.array([0.02, 0.0, -0.012])
_LIFT_MPS = 0.125
_LOST_M = 0.06  # distance from the middle between the palms at which the cube counts as lost
# longest durations of approach and lowering; durations of closing and opening
_LIFT_APPROACH_S, _LIFT_LOWER_S, _LIFT_CLOSE_S, _LIFT_OPEN_S = 1.4, 1.2, 0.8, 0.48


def lift(child: Humanoid, palms: PalmMotion, toy: Prop, height_m: float) -> Iterator[Floats]:
    """Yield target angles ``(82,)`` rad, one array per step: grip, lift and hold a cube.

    The sequence never ends; it starts again when the cube is lost.

    Args:
        child: The body that lifts.
        palms: Controller of its hands.
        toy: The cube.
        height_m: Height to which the palms lift it.
    """
    edge = float(toy.cfg.size_m[0])
    wide, tight = edge + 2 * _CLEARANCE_M, edge - 2 * _SQUEEZE_M
    while True:
        yaw = quarter_yaw(toy)
        for offset, most_s in ((_ABOVE, _LIFT_APPROACH_S), (_GRIP_OFFSET, _LIFT_LOWER_S)):
            for _ in range(palms.steps(most_s)):
                goal = Grip(toy.position + offset, wide, yaw)
                yield palms.move(goal)
                if palms.is_at(goal):
                    break
        place = toy.position + _GRIP_OFFSET
        yield from palms.during(Grip(place, tight, yaw), _LIFT_CLOSE_S)
        up = np.array([place[0], place[1], height_m])
        while slip_m(child, toy) < _LOST_M:
            yield palms.move(Grip(up, tight, yaw), _LIFT_MPS)
        for _ in range(palms.steps(_LIFT_OPEN_S)):
            yield palms.move(Grip(child.palms().mean(axis=0), wide, yaw))


def slip_m(child: Humanoid, toy: Prop) -> float:
    """Return the distance of a cube from the middle between the palms, metres."""
    return float(np.linalg.norm(child.palms().mean(axis=0) - toy.position))

"""Expert of PushOut1v1 and PushOut2v2."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import Clearances, bearing_rad, locomotion_of
from veca_marl.envs.tasks.push_out import PushOut, nearest
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats

# Angle by which the path passes beside the opponent: greatest when pushing would move it inwards,
# plus a part that grows with how directly the opponent faces the body.
_DETOUR_RAD, _FACED_DETOUR_RAD = 1.0, 0.8


def pushing_goal(
    body: Body, clearances: Clearances, other: Body, middle: Floats, radius_m: float
) -> Floats:
    """Return the point to steer to in order to push another body out of a ring.

    Two bodies that face each other hold each other. The path therefore leads round the opponent on
    the side of the middle, from where pushing moves it outwards. A body that has no contact, or is
    farther out than its opponent, keeps a distance from the rim.

    Args:
        body: The body that pushes.
        clearances: Distances that it needs.
        other: The opponent.
        middle: Middle of the ring, ``(2,)`` metres.
        radius_m: Radius of the ring.

    Returns:
        ``(2,)`` metres.
    """
    here, there = body.position[:2], other.position[:2]
    way = there - here
    in_contact = float(np.hypot(*way)) < clearances.other_m
    outwards = _cosine(way, there - middle)
    faced = max(_cosine(other.forward[:2], -way), 0.0) if in_contact else 0.0
    detour_rad = _DETOUR_RAD * (1.0 - outwards) / 2.0 + _FACED_DETOUR_RAD * faced
    goal = here + _rotated(way, math.copysign(detour_rad, _cross(way, middle - here)))
    here_m, there_m = (float(np.hypot(*(place - middle))) for place in (here, there))
    is_inside = here_m < there_m - clearances.other_m / 4.0
    if in_contact and is_inside and _cosine(body.forward[:2], way) > 0.5:
        return goal
    if here_m > radius_m - 2.0 * clearances.turning_m:
        return middle
    return _nearest_in_disc(goal, middle, radius_m - clearances.other_m)


def _nearest_in_disc(place: Floats, middle: Floats, radius_m: float) -> Floats:
    way = place - middle
    return middle + way * min(radius_m / max(float(np.hypot(*way)), 1e-9), 1.0)


def _rotated(way: Floats, angle_rad: float) -> Floats:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])


def _cosine(a: Floats, b: Floats) -> float:
    return float(a @ b) / max(float(np.hypot(*a) * np.hypot(*b)), 1e-9)


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


@register_expert("PushOut1v1")
@register_expert("PushOut2v2")
class PushOutExpert(Expert[PushOut]):
    """Goes round the nearest opponent and pushes it outwards.

    A crawling body moves backwards where a walker turns round, since turning takes space. Reads
    the positions and headings of all players, and middle and radius of the ring from the simulator
    (privileged); on hands and knees also its own joint angles and the orientations of chest and
    pelvis, with which it gets up after a fall.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._locomotion = locomotion_of(self.player, self.task.world.clock.step_s)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        task, body, clearances = self.task, self.player.body, self._locomotion.clearances
        other = nearest(body, task.opponents_playing(self.player))
        goal = pushing_goal(body, clearances, other, task.ring.middle, task.ring.radius_m)
        if abs(bearing_rad(body, goal)) > clearances.back_rad:
            return self._locomotion.back()
        return self._locomotion.to(goal)

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()

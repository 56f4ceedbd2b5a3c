"""Crawling on hands and knees: each knee moves with the hand of the other side."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.envs.task import Player
from veca_marl.sim.bodies.humanoid import Humanoid
from veca_marl.sim.bodies.joint_controls import Springs
from veca_marl.sim.bodies.postures import ON_ALL_FOURS
from veca_marl.sim.pose import Floats

# Drawn by hand, then improved by a random search for the way covered, with torques and with
# position targets. Each joint, in degrees: its middle, how far it swings to and fro with its limb,
# and how much it bends besides while the limb goes forward.
_FREQUENCY_HZ = 0.84
_LEAD_RAD = 0.25  # of the hand before the knee of the other side
_LEG = {
    "thigh.flexion": (94.0, 22.6, 10.6),
    "thigh.abduction": (17.6, 0.0, -2.1),
    "shank.flexion": (109.5, 9.8, 17.5),
    "foot.dorsiflexion": (-58.0, 0.0, 0.0),
}
_ARM = {
    "upper_arm.flexion": (74.5, 27.0, 13.2),
    "upper_arm.abduction": (13.4, 0.0, 0.0),
    "forearm.flexion": (-4.3, 0.0, 37.1),
    "hand.flexion": (-82.0, 0.0, 0.0),
}
_TRUNK = {"spine.flexion": 20.7, "neck.flexion": -45.0}
_BEND = {"spine.lateral": -10.7, "chest.lateral": -10.7, "chest.rotation": -0.7}
_BEND_LEAD_RAD = -0.01
_BEGIN_S = 0.4
# a trunk twisted to one side turns the child there: by torques 45 degrees in 6 s in the median, but
# single tries differ much (mitten, five each way: 23 to 72 to the left, 66 right to 109 left to the
# right); a third of the speed is lost, and with 30 degrees and more it turns either way
_TWIST_DEG = {"spine.rotation": 20.0, "chest.rotation": 20.0}
_FULL_TURN_RAD = 0.5  # to the side of the way: worth a full turn
_BEFORE_M = 0.1  # a place nearer than that is not worth a stride


class Crawl:
    """A rhythm in time; it grows out of the posture at the start.

    Args:
        body: Who crawls.
        step_s: Time between two wishes.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._joint = {name: index for index, name in enumerate(body.joint_names)}
        self.reset()

    def reset(self) -> None:
        """Begin where the joints are."""
        self._time_s, self._start = 0.0, self._body.joint_angles()

    def wish(self, turn: float = 0.0) -> Springs:
        """Return where springs shall pull the joints now.

        Args:
            turn: How much to turn while crawling, in [-1, 1], left is positive.
        """
        share = min(1.0, self._time_s / _BEGIN_S)
        phase = 2.0 * math.pi * _FREQUENCY_HZ * self._time_s
        self._time_s += self._step_s
        angles = self._start + share * (self._rhythm(phase, turn) - self._start)
        return Springs(angles, ahead_s=0.0)

    def _rhythm(self, phase: float, turn: float) -> Floats:
        degrees = np.zeros(len(self._joint))
        for side, shift in (("l_", 0.0), ("r_", math.pi)):
            self._move(degrees, side, _LEG, phase + shift)
            self._move(degrees, side, _ARM, phase + shift + math.pi + _LEAD_RAD)
        for name, angle in _TRUNK.items():
            degrees[self._joint[name]] = angle
        for name, angle in _BEND.items():
            degrees[self._joint[name]] = angle * math.sin(phase + _BEND_LEAD_RAD)
        for name, angle in _TWIST_DEG.items():
            degrees[self._joint[name]] += angle * turn
        return np.radians(degrees)

    def _move(
        self,
        degrees: Floats,
        side: str,
        limb: dict[str, tuple[float, float, float]],
        phase: float,
    ) -> None:
        forward = max(0.0, math.cos(phase))
        for name, (middle, swing, bend) in limb.items():
            degrees[self._joint[side + name]] = middle + swing * math.sin(phase) + bend * forward


def crawl_to(body: Humanoid, crawl: Crawl, place: Floats) -> Springs:
    """Return the wish of who wants to get to a place, and on through it.

    It turns towards it on the whole, not in every stride, so it may miss, see `_TWIST_DEG`.

    Args:
        body: Who crawls.
        crawl: Its rhythm.
        place: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
    """
    way, ahead = place[:2] - body.position[:2], body.forward
    left = math.atan2(ahead[0] * way[1] - ahead[1] * way[0], ahead[:2] @ way)
    return crawl.wish(min(max(left / _FULL_TURN_RAD, -1.0), 1.0))


def keep_near(body: Humanoid, crawl: Crawl, place: Floats) -> Floats | Springs:
    """Return the wish of who wants to be at a place: crawl while it lies ahead, else kneel still.

    Args:
        body: Who crawls.
        crawl: Its rhythm.
        place: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
    """
    if (place[:2] - body.position[:2]) @ body.forward[:2] > _BEFORE_M:
        return crawl_to(body, crawl, place)
    return body.angles_of(ON_ALL_FOURS)


def crawls_of(players: Sequence[Player], step_s: float) -> dict[str, Crawl]:
    """Return the rhythm of each player who may crawl, by name."""
    return {
        player.name: Crawl(player.body, step_s)
        for player in players
        if isinstance(player.body, Humanoid)
    }

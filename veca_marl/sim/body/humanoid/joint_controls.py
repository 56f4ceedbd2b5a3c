"""Action rows of the joint-level body: normalised torques, or angles to go to."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.body.anatomy.skin_springs import is_finger
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.calls import Call


class Springs(NamedTuple):
    """A wish of joints in more detail than angles alone.

    Attributes:
        targets: ``(82,)`` rad, where springs pull the joints to.
        ahead_s: Their stretch is measured so long ahead. One agent step is calm, see
            `foresight`; 0 s is as strong as can be, and shakes who keeps still.
        call: What is called, by a body that has a vocabulary of calls.
    """

    targets: Floats
    ahead_s: float
    call: Call = Call.none


class JointControl(Protocol):
    """Turns a wish in [-1, 1] for every joint into its motor's torque, at every physics step."""

    def shares(self, wishes: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return torques as shares of each joint's strength.

        Args:
            wishes: ``(n,)`` in [-1, 1].
            angles: ``(n,)`` rad, now.
            low: ``(n,)`` rad, the lower stops.
            high: ``(n,)`` rad, the upper stops.
        """
        ...

    def wishes(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the wishes that take the joints to target angles, as an expert's.

        Args:
            targets: ``(n,)`` rad.
            angles: ``(n,)`` rad, where the joints will be at the end of the agent step.
            low: ``(n,)`` rad, the lower stops.
            high: ``(n,)`` rad, the upper stops.
        """
        ...


# From so far away a joint is pulled to its target with full strength. The joint's own damping
# brakes it: no further damping can make the explicit integration unstable.
REACH_RAD = 0.25


def _pull(targets: Floats, angles: Floats) -> Floats:
    """Return the shares of a spring that ends at full strength."""
    return np.clip((targets - angles) / REACH_RAD, -1.0, 1.0)


class NormalisedTorque:
    """A wish is a share of the joint's strength (the paper's `apply_torque`)."""

    def shares(self, wishes: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """See `JointControl`."""
        return wishes

    def wishes(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """See `JointControl`: what a spring to the targets would give there."""
        return _pull(targets, angles)


class PositionTarget:
    """A wish is an angle: -1 and 1 are the stops, 0 is the neutral standing angle."""

    def shares(self, wishes: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """See `JointControl`."""
        return _pull(np.where(wishes >= 0.0, wishes * high, -wishes * low), angles)

    def wishes(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """See `JointControl`: the targets as shares of the way to the stops."""
        ranges = np.where(targets >= 0.0, high, -low)
        shares = np.divide(targets, ranges, out=np.zeros(len(targets)), where=ranges > 0.0)
        return np.clip(shares, -1.0, 1.0)


class Rows(Protocol):
    """Turns action rows into the wishes of the joints that they are for."""

    def start(self, staying: Floats) -> Floats:
        """Return the ``(n,)`` wishes of who has just been placed.

        Args:
            staying: ``(n,)`` in [-1, 1], the wishes that would keep the posture.
        """
        ...

    def heed(self, row: Floats, wishes: Floats) -> Floats:
        """Return the wishes after an action row; all ``(n,)`` in [-1, 1]."""
        ...

    def towards(self, wanted: Floats, wishes: Floats) -> Floats:
        """Return the row that brings the wishes nearest to those wanted; all ``(n,)``."""
        ...


class WholeRows:
    """A row holds the wishes themselves."""

    def start(self, staying: Floats) -> Floats:
        """See `Rows`: relaxed, or on the way to the neutral angle."""
        return np.zeros(len(staying))

    def heed(self, row: Floats, wishes: Floats) -> Floats:
        """See `Rows`."""
        return row

    def towards(self, wanted: Floats, wishes: Floats) -> Floats:
        """See `Rows`."""
        return wanted


# A target goes from the neutral angle to a stop in 7 agent steps, 0.27 s: as fast as a child may
# want to move, and slow enough that the noise of a policy adds up to movements.
INCREMENT = 0.15


class IncrementRows:
    """A row says how far the wishes go on: with targets, zeros keep the posture, and stiffly.

    Independent noise in each row, as policies explore, makes torques and target angles tremble
    about one place; here it adds up to a random walk, so that postures are explored (the same
    thought as in temporally correlated noise, Lillicrap et al. 2016, "Continuous control with deep
    reinforcement learning", section 3).
    """

    def start(self, staying: Floats) -> Floats:
        """See `Rows`: stay so."""
        return staying

    def heed(self, row: Floats, wishes: Floats) -> Floats:
        """See `Rows`."""
        return np.clip(wishes + INCREMENT * row, -1.0, 1.0)

    def towards(self, wanted: Floats, wishes: Floats) -> Floats:
        """See `Rows`: as much of the way as one row can."""
        return np.clip((wanted - wishes) / INCREMENT, -1.0, 1.0)


class JointActionKind(Enum):
    """How the joints are commanded."""

    torque = "torque"
    position = "position"
    increment = "increment"


class JointAction(NamedTuple):
    """How action rows move joints.

    Attributes:
        control: What a wish does to a joint.
        rows: What a row does to the wishes.
    """

    control: JointControl
    rows: Rows


JOINT_ACTIONS: dict[JointActionKind, JointAction] = {
    JointActionKind.torque: JointAction(NormalisedTorque(), WholeRows()),
    JointActionKind.position: JointAction(PositionTarget(), WholeRows()),
    JointActionKind.increment: JointAction(PositionTarget(), IncrementRows()),
}


class JointChoice(Enum):
    """Which joints an action row moves; the others are left without torque or at 0."""

    all = "all"
    limbs = "limbs"


def chosen_joints(skeleton: Skeleton, choice: JointChoice) -> list[int]:
    """Return the joints of a choice: all 82, or the 40 that are not in fingers."""
    joints = range(len(skeleton.joints))
    if choice is JointChoice.all:
        return list(joints)
    bones = {bone.name: bone for bone in skeleton.bones}
    return [i for i in joints if not is_finger(bones[skeleton.joints[i].bone])]

"""The `joints` part of a joint-level body's action, and the control that turns it into torques.

An action changes the set-points of the joints (`SetPointUpdate`); at every physics step the control
turns the set-points into torques (`JointControl`). Set-points are normalised to [-1, 1].
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton, is_finger
from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import Call


class JointCommand(NamedTuple):
    """A command of an expert to all joints.

    Attributes:
        targets: ``(82,)`` rad, target angles.
        horizon_s: How far ahead the angles are predicted from which the torques follow, see
            `predicted_angles`. One agent step damps the motion; 0 s gives the greatest torques,
            with which a body at rest oscillates.
        call: The call of a body whose action has a part `voice`.
    """

    targets: Floats
    horizon_s: float
    call: Call = Call.none


class JointControl(Protocol):
    """Computes torques from set-points, and set-points from target angles."""

    def torques(self, set_points: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return normalised torques ``(n,)`` in [-1, 1] of each joint's greatest torque.

        Args:
            set_points: ``(n,)`` in [-1, 1].
            angles: ``(n,)`` rad, present joint angles.
            low: ``(n,)`` rad, lower joint limits.
            high: ``(n,)`` rad, upper joint limits.
        """
        ...

    def stiffness(self, torques: Floats) -> Floats:
        """Return by how much torques decrease with the angle, ``(n,)`` 1/rad.

        Args:
            torques: ``(n,)`` the normalised torques at the present angles.
        """
        ...

    def set_points(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the set-points ``(n,)`` that move the joints to target angles.

        Args:
            targets: ``(n,)`` rad.
            angles: ``(n,)`` rad, predicted joint angles at the end of the agent step.
            low: ``(n,)`` rad, lower joint limits.
            high: ``(n,)`` rad, upper joint limits.
        """
        ...


# Angle error at which the proportional control reaches the greatest torque. The joint's own damping
# is the only damping.
SATURATION_RAD = 0.25


def _proportional(targets: Floats, angles: Floats) -> Floats:
    """Return the normalised torques of a proportional control, clipped to [-1, 1]."""
    return np.clip((targets - angles) / SATURATION_RAD, -1.0, 1.0)


class TorqueControl:
    """A set-point is a normalised torque (the paper's `apply_torque`)."""

    def torques(self, set_points: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the set-points."""
        return set_points

    def stiffness(self, torques: Floats) -> Floats:
        """Return zeros: the torques do not depend on the angles."""
        return np.zeros(len(torques))

    def set_points(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the torques of a proportional control at the predicted angles."""
        return _proportional(targets, angles)


class PositionControl:
    """A set-point is a target angle: -1 and 1 are the joint limits, 0 is the neutral angle."""

    def torques(self, set_points: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the torques of a proportional control to the target angles."""
        targets = np.where(set_points >= 0.0, set_points * high, -set_points * low)
        return _proportional(targets, angles)

    def stiffness(self, torques: Floats) -> Floats:
        """Return the gain of the proportional control, or 0 where the torque is saturated."""
        return np.where(np.abs(torques) < 1.0, 1.0 / SATURATION_RAD, 0.0)

    def set_points(self, targets: Floats, angles: Floats, low: Floats, high: Floats) -> Floats:
        """Return the targets as fractions of the joint limits."""
        ranges = np.where(targets >= 0.0, high, -low)
        fractions = np.divide(targets, ranges, out=np.zeros(len(targets)), where=ranges > 0.0)
        return np.clip(fractions, -1.0, 1.0)


class SetPointUpdate(Protocol):
    """How an action changes the set-points of the joints that it moves. All are ``(n,)``."""

    def start(self, holding: Floats) -> Floats:
        """Return the set-points of a body that has just been placed.

        Args:
            holding: The set-points in [-1, 1] that would hold the posture.
        """
        ...

    def apply(self, action: Floats, set_points: Floats) -> Floats:
        """Return the set-points after an action; all in [-1, 1]."""
        ...

    def encode(self, wanted: Floats, set_points: Floats) -> Floats:
        """Return the action that brings the set-points nearest to wanted ones."""
        ...


class AbsoluteUpdate:
    """An action is the new set-points."""

    def start(self, holding: Floats) -> Floats:
        """Return zeros: no torque, or the neutral angles as targets."""
        return np.zeros(len(holding))

    def apply(self, action: Floats, set_points: Floats) -> Floats:
        """Return the action."""
        return action

    def encode(self, wanted: Floats, set_points: Floats) -> Floats:
        """Return the wanted set-points."""
        return wanted


# A full action moves a target from the neutral angle to a joint limit in 7 agent steps, 0.27 s:
# fast enough for voluntary movement, and slow enough that the noise of a policy adds up to movement
INCREMENT = 0.15


class IncrementalUpdate:
    """An action is added to the set-points; with targets, zeros hold the posture stiffly.

    Independent noise in each action, with which policies explore, makes torques and target angles
    fluctuate about one point; here it adds up to a random walk, so that postures are explored (the
    idea of temporally correlated noise in Lillicrap et al. 2016, "Continuous control with deep
    reinforcement learning", section 3).
    """

    def start(self, holding: Floats) -> Floats:
        """Return the set-points that hold the posture."""
        return holding

    def apply(self, action: Floats, set_points: Floats) -> Floats:
        """Return the set-points moved by at most `INCREMENT`, clipped to [-1, 1]."""
        return np.clip(set_points + INCREMENT * action, -1.0, 1.0)

    def encode(self, wanted: Floats, set_points: Floats) -> Floats:
        """Return the difference in units of `INCREMENT`, clipped to [-1, 1]."""
        return np.clip((wanted - set_points) / INCREMENT, -1.0, 1.0)


class JointActionKind(Enum):
    """How the joints are commanded."""

    torque = "torque"
    position = "position"
    increment = "increment"


class JointAction(NamedTuple):
    """How the `joints` part of an action moves the joints.

    Attributes:
        control: From set-points to torques.
        update: From actions to set-points.
    """

    control: JointControl
    update: SetPointUpdate


JOINT_ACTIONS: dict[JointActionKind, JointAction] = {
    JointActionKind.torque: JointAction(TorqueControl(), AbsoluteUpdate()),
    JointActionKind.position: JointAction(PositionControl(), AbsoluteUpdate()),
    JointActionKind.increment: JointAction(PositionControl(), IncrementalUpdate()),
}


class JointChoice(Enum):
    """Which joints an action moves.

    The others have no torque; as targets they have the angle 0 (`position`), or the angles at which
    the body was placed (`increment`).

    Attributes:
        all: All 82.
        limbs: The 40 that are not in fingers.
        arms: The 14 of both arms, from the shoulders to the wrists.
    """

    all = "all"
    limbs = "limbs"
    arms = "arms"


_ARM = ("_upper_arm", "_forearm", "_hand")


def chosen_joints(skeleton: Skeleton, choice: JointChoice) -> list[int]:
    """Return the indices of the joints of a choice, in ascending order."""
    bones = {bone.name: bone for bone in skeleton.bones}
    owners = [bones[joint.bone] for joint in skeleton.joints]
    match choice:
        case JointChoice.all:
            return list(range(len(owners)))
        case JointChoice.limbs:
            return [index for index, bone in enumerate(owners) if not is_finger(bone)]
        case JointChoice.arms:
            return [index for index, bone in enumerate(owners) if bone.name.endswith(_ARM)]

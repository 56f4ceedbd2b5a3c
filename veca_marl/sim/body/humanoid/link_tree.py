"""The arrays in which the kernels keep the state of a body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats


class LinkArrays(NamedTuple):
    """Where the links of a tree of n hinges are; written by `locate_links`.

    Attributes:
        rotations: ``(n + 1, 3, 3)`` from the links' frames to the world.
        origins: ``(n + 1, 3)`` metres from the reference point.
        hinges: ``(n, 6)`` spatial velocity of each link for 1 rad/s of its hinge.
        moments: ``(n + 1, 3)`` kg m, mass times centre of mass from the reference point.
        inertias: ``(n + 1, 3, 3)`` kg m^2 about the reference point, world axes.
    """

    rotations: Floats
    origins: Floats
    hinges: Floats
    moments: Floats
    inertias: Floats


class BodyState(NamedTuple):
    """Pose and velocity of a body, and what follows from them. All are written in place.

    Attributes:
        position: ``(3,)`` metres, the base's centre of mass: the reference point.
        rotation: ``(3, 3)`` of the base.
        angles: ``(n,)`` rad.
        velocity: ``(6 + n,)`` generalised velocity.
        momentum: ``(6,)`` angular momentum about the centre of mass, N m s, and momentum, kg m/s.
        centre: ``(3,)`` metres, the centre of mass from the reference point.
        mass_matrix: ``(6 + n, depth)``, stored as in `factorisation`.
        bias: ``(6 + n,)`` generalised forces that keep the velocity constant, without weight.
    """

    position: Floats
    rotation: Floats
    angles: Floats
    velocity: Floats
    momentum: Floats
    centre: Floats
    mass_matrix: Floats
    bias: Floats


class SolverState(NamedTuple):
    """What Bullet has after a physics step. All but the last two are views of `numbers`.

    Attributes:
        numbers: ``(13 + 2 n,)``, all that Bullet has: the arrays below, one after the other.
        position: ``(3,)`` metres, the base's centre of mass.
        quaternion: ``(4,)`` (x, y, z, w), orientation of the base.
        velocity: ``(6 + n,)`` generalised velocity.
        angles: ``(n,)`` rad.
        changed: ``(n,)`` whether `settle` changed angle or speed of a joint.
        turn: ``(6,)`` scratch of `settle`.
    """

    numbers: Floats
    position: Floats
    quaternion: Floats
    velocity: Floats
    angles: Floats
    changed: NDArray[np.bool_]
    turn: Floats


def empty_solver_state(hinges: int) -> SolverState:
    """Return arrays for Bullet's state."""
    numbers = np.zeros(13 + 2 * hinges)
    position, quaternion, velocity, angles = np.split(numbers, np.cumsum([3, 4, 6 + hinges]))
    changed, turn = np.zeros(hinges, np.bool_), np.zeros(6)
    return SolverState(numbers, position, quaternion, velocity, angles, changed, turn)


def empty_links(hinges: int) -> LinkArrays:
    """Return arrays for the links of a tree."""
    return LinkArrays(
        rotations=np.zeros((hinges + 1, 3, 3)),
        origins=np.zeros((hinges + 1, 3)),
        hinges=np.zeros((hinges, 6)),
        moments=np.zeros((hinges + 1, 3)),
        inertias=np.zeros((hinges + 1, 3, 3)),
    )


def empty_state(hinges: int, depth: int) -> BodyState:
    """Return arrays for the state of a body; `depth` is that of its tree's paths."""
    rows = 6 + hinges
    return BodyState(
        position=np.zeros(3),
        rotation=np.eye(3),
        angles=np.zeros(hinges),
        velocity=np.zeros(rows),
        momentum=np.zeros(6),
        centre=np.zeros(3),
        mass_matrix=np.zeros((rows, depth)),
        bias=np.zeros(rows),
    )


class JointLimits(NamedTuple):
    """Limits of the joints.

    Attributes:
        low: ``(n,)`` rad, lower limits.
        high: ``(n,)`` rad, upper limits.
        speed: rad/s, greatest speed of all joints.
        margin: rad, joints are stopped this far inside `low` and `high`.
    """

    low: Floats
    high: Floats
    speed: float
    margin: float


class JointForces(NamedTuple):
    """Forces on a body of n hinges. All are written in place.

    Attributes:
        drive: ``(n,)`` N m, torques of the motors at the start of a step.
        stiffness: ``(n,)`` N m/rad, by which these decrease with the angle.
        damping: ``(n,)`` N m s/rad.
        torques: ``(n,)`` N m, what Bullet applies in the step.
        external: ``(6 + n,)`` generalised forces of weight and contacts in the last step.
        before: ``(6 + n,)`` those of the step before it.
        predicted: ``(6 + n,)`` those that are predicted for the next step.
        held: ``(n,)`` 1 or -1 for joints that are held at their upper or lower limit, else 0.
        accelerations: ``(6 + n,)`` predicted generalised accelerations.
        matrix: ``(6 + n, depth)`` scratch, stored as in `factorisation`.
        scratch: ``(6 + n,)``.
    """

    drive: Floats
    stiffness: Floats
    damping: Floats
    torques: Floats
    external: Floats
    before: Floats
    predicted: Floats
    held: Floats
    accelerations: Floats
    matrix: Floats
    scratch: Floats


def empty_forces(hinges: int, depth: int) -> JointForces:
    """Return arrays of zeros; `depth` is that of the tree's paths."""
    rows = 6 + hinges
    drive, stiffness, damping, torques, held = (np.zeros(hinges) for _ in range(5))
    external, before, predicted, accelerations, scratch = (np.zeros(rows) for _ in range(5))
    matrix = np.zeros((rows, depth))
    return JointForces(
        drive,
        stiffness,
        damping,
        torques,
        external,
        before,
        predicted,
        held,
        accelerations,
        matrix,
        scratch,
    )

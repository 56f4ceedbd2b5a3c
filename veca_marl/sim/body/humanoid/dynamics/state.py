"""The arrays in which the kernels keep the state of a body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
        mass_matrix: ``(6 + n, 6 + n)``.
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
    """What Bullet has after a physics step.

    Attributes:
        quaternion: ``(4,)`` (x, y, z, w), orientation of the base.
        angles: ``(n,)`` rad.
        velocity: ``(6 + n,)`` generalised velocity.
        turn: ``(6,)`` scratch of `settle`.
    """

    quaternion: Floats
    angles: Floats
    velocity: Floats
    turn: Floats


def empty_solver_state(hinges: int) -> SolverState:
    """Return arrays for Bullet's state."""
    return SolverState(np.zeros(4), np.zeros(hinges), np.zeros(6 + hinges), np.zeros(6))


def empty_links(hinges: int) -> LinkArrays:
    """Return arrays for the links of a tree."""
    return LinkArrays(
        rotations=np.zeros((hinges + 1, 3, 3)),
        origins=np.zeros((hinges + 1, 3)),
        hinges=np.zeros((hinges, 6)),
        moments=np.zeros((hinges + 1, 3)),
        inertias=np.zeros((hinges + 1, 3, 3)),
    )


def empty_state(hinges: int) -> BodyState:
    """Return arrays for the state of a body."""
    rows = 6 + hinges
    return BodyState(
        position=np.zeros(3),
        rotation=np.eye(3),
        angles=np.zeros(hinges),
        velocity=np.zeros(rows),
        momentum=np.zeros(6),
        centre=np.zeros(3),
        mass_matrix=np.zeros((rows, rows)),
        bias=np.zeros(rows),
    )

"""Joint limits and the momentum of a body after a physics step of Bullet.

Bullet stores joint angles and speeds in which the momentum of a free body drifts: its integrator
uses the accelerations of the old pose at the new one, and joint angles that are set back to their
limits move the body's centre of mass. The external impulse of the step is known nevertheless: it
is what the base's six rows of Newton's law, evaluated at the pose before the step, leave over. So
momentum and angular momentum after the step are known, and base pose and base velocity follow from
them and from the joints.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from veca_marl.sim.body.humanoid.dynamics.factorisation import factorise, solve
from veca_marl.sim.body.humanoid.dynamics.inertial_forces import write_bias, write_mass_matrix
from veca_marl.sim.body.humanoid.dynamics.link_poses import locate_links
from veca_marl.sim.body.humanoid.dynamics.small_vectors import add_cross
from veca_marl.sim.body.humanoid.dynamics.state import BodyState, LinkArrays, SolverState
from veca_marl.sim.body.humanoid.dynamics.tree import LinkTree
from veca_marl.sim.geometry import Floats, quaternions_to_matrices


@njit(cache=True)
def update_inertia(tree: LinkTree, state: BodyState, links: LinkArrays) -> None:
    """Write what follows from the pose: links, mass matrix and centre of mass."""
    locate_links(tree, state.rotation, state.angles, links)
    write_mass_matrix(tree, links, state.centre, state.mass_matrix)


@njit(cache=True)
def update_bias(tree: LinkTree, state: BodyState, links: LinkArrays) -> None:
    """Write what follows from pose and velocity: the bias forces."""
    write_bias(tree, links, state.velocity, state.bias)


@njit(cache=True)
def write_momentum(state: BodyState) -> None:
    """Write the momentum that follows from pose and velocity."""
    for i in range(6):
        state.momentum[i] = 0.0
        for j in range(state.velocity.shape[0]):
            state.momentum[i] += state.mass_matrix[i, j] * state.velocity[j]
    add_cross(state.momentum[3:], state.centre, state.momentum[:3])


@njit(cache=True)
def write_external_impulse(
    step_s: float, solver: SolverState, state: BodyState, impulse: Floats
) -> None:
    """Write the impulse ``(6,)`` of all external forces during a physics step.

    It is the base's rows of ``M (v' - v) + dt h``, with mass matrix M and bias h at the pose before
    the step: N m s about the centre of mass, then N s.
    """
    for i in range(6):
        impulse[i] = step_s * state.bias[i]
        for j in range(state.velocity.shape[0]):
            impulse[i] += state.mass_matrix[i, j] * (solver.velocity[j] - state.velocity[j])
    add_cross(impulse[3:], state.centre, impulse[:3])


@njit(cache=True)
def settle(
    tree: LinkTree,
    low: Floats,
    high: Floats,
    top_speed: float,
    step_s: float,
    impulse: Floats,
    solver: SolverState,
    state: BodyState,
    links: LinkArrays,
    changed: Floats,
) -> None:
    """Apply joint limits to the state after a step and give the base the momentum that it has.

    Args:
        tree: The tree of n hinges.
        low: ``(n,)`` rad, lower joint limits.
        high: ``(n,)`` rad, upper joint limits.
        top_speed: rad/s, limit of joint speeds.
        step_s: Duration of the physics step.
        impulse: ``(6,)`` external impulse of the step, from `write_external_impulse`.
        solver: Bullet's state after the step; angles, joint speeds and orientation are overwritten.
        state: The state before the step; overwritten by the one after it.
        links: The links before the step; overwritten.
        changed: ``(n,)``, written: 1 for joints with a changed angle or speed, else 0.
    """
    goal, mass = np.empty(3), np.sum(tree.masses)
    state.momentum[:] += impulse
    for i in range(3):
        goal[i] = state.position[i] + state.centre[i] + step_s * state.momentum[3 + i] / mass
    if _apply_limits(low, high, top_speed, state.mass_matrix, solver, changed):
        _turn_base(state.mass_matrix, solver)
    quaternions_to_matrices(solver.quaternion.reshape(1, 4), state.rotation.reshape(1, 3, 3))
    state.angles[:] = solver.angles
    update_inertia(tree, state, links)
    for i in range(3):
        state.position[i] = goal[i] - state.centre[i]
    _write_velocity(state, solver.velocity)
    update_bias(tree, state, links)


@njit(cache=True)
def _apply_limits(
    low: Floats,
    high: Floats,
    top_speed: float,
    mass_matrix: Floats,
    solver: SolverState,
    changed: Floats,
) -> bool:
    """Clip angles and joint speeds; return whether an angle was changed.

    For each change of an angle the impulse that an internal motor would leave on the base is added
    to the base's turn.
    """
    moved = False
    solver.turn[:] = 0.0
    for joint in range(low.shape[0]):
        angle = min(max(solver.angles[joint], low[joint]), high[joint])
        speed = min(max(solver.velocity[6 + joint], -top_speed), top_speed)
        changed[joint] = 0.0
        if speed != solver.velocity[6 + joint]:
            solver.velocity[6 + joint] = speed
            changed[joint] = 1.0
        if angle != solver.angles[joint]:
            for i in range(6):
                solver.turn[i] -= mass_matrix[i, 6 + joint] * (angle - solver.angles[joint])
            solver.angles[joint] = angle
            changed[joint] = 1.0
            moved = True
    return moved


@njit(cache=True)
def _turn_base(mass_matrix: Floats, solver: SolverState) -> None:
    """Rotate the base by as much as it reacts on the changes of angles."""
    block = mass_matrix[:6, :6].copy()
    factorise(np.arange(-1, 5), block)
    solve(np.arange(-1, 5), block, solver.turn)
    turn, q = solver.turn, solver.quaternion
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    share = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    a, b, c, w = share * turn[0], share * turn[1], share * turn[2], math.cos(0.5 * angle)
    x, y, z = q[0], q[1], q[2]
    q[0] = w * x + a * q[3] + b * z - c * y
    q[1] = w * y + b * q[3] + c * x - a * z
    q[2] = w * z + c * q[3] + a * y - b * x
    q[3] = w * q[3] - a * x - b * y - c * z


@njit(cache=True)
def _write_velocity(state: BodyState, velocity: Floats) -> None:
    """Write the velocity of the base that gives the body its momentum at the new pose."""
    base = state.momentum.copy()
    add_cross(state.centre, state.momentum[3:], base[:3])
    block = state.mass_matrix[:6, :6].copy()
    for i in range(6):
        for j in range(6, velocity.shape[0]):
            base[i] -= state.mass_matrix[i, j] * velocity[j]
    factorise(np.arange(-1, 5), block)
    solve(np.arange(-1, 5), block, base)
    state.velocity[:6] = base
    state.velocity[6:] = velocity[6:]

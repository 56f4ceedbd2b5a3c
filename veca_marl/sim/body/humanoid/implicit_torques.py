"""Joint torques with which Bullet's explicit step has the result of an implicit one.

Joint damping is large relative to the inertia of light links: an explicit damping torque would be
unstable at physics steps of 8 ms. The torques here are those of springs and dampers at the end of
the step, see `write_torques`.

A mass matrix is zero where two rows are on different branches of the tree. Its lower half is stored
without these zeros: element d of row i is that of column ``paths[i, d]``, see `LinkTree`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.humanoid.link_tree import (
    BodyState,
    JointForces,
    JointLimits,
    LinkTree,
    SolverState,
)
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel

Indices = NDArray[np.int64]


@kernel
def factorise(depths: Indices, paths: Indices, matrix: Floats) -> None:
    """Replace the lower half of a matrix M by L with ``M = L^T L`` (Featherstone 2008, table 6.3).

    Args:
        depths: ``(m,)``, see `LinkTree`.
        paths: ``(m, depth)``.
        matrix: ``(m, depth)`` lower half of a positive definite matrix.
    """
    for k in range(depths.shape[0] - 1, -1, -1):
        last = depths[k] - 1
        root = np.sqrt(matrix[k, last])
        matrix[k, last] = root
        for d in range(last):
            matrix[k, d] /= root
        for d in range(last):
            share, row = matrix[k, d], paths[k, d]
            for e in range(d + 1):
                matrix[row, e] -= share * matrix[k, e]


@kernel
def solve(depths: Indices, paths: Indices, factor: Floats, x: Floats) -> None:
    """Replace the right side ``(m,)`` by the solution, with the factor from `factorise`."""
    for i in range(depths.shape[0] - 1, -1, -1):
        last = depths[i] - 1
        x[i] /= factor[i, last]
        for d in range(last):
            x[paths[i, d]] -= factor[i, d] * x[i]
    for i in range(depths.shape[0]):
        last = depths[i] - 1
        for d in range(last):
            x[i] -= factor[i, d] * x[paths[i, d]]
        x[i] /= factor[i, last]


@kernel
def add_product(depths: Indices, paths: Indices, matrix: Floats, x: Floats, out: Floats) -> None:
    """Add the product of a matrix and a vector ``(m,)`` to `out`."""
    for i in range(depths.shape[0]):
        last = depths[i] - 1
        out[i] += matrix[i, last] * x[i]
        for d in range(last):
            column = paths[i, d]
            out[i] += matrix[i, d] * x[column]
            out[column] += matrix[i, d] * x[i]


def dense(depths: Indices, paths: Indices, matrix: Floats) -> Floats:
    """Return a stored matrix as an array ``(m, m)``."""
    full = np.zeros((len(depths), len(depths)))
    for row, depth in enumerate(depths):
        columns = paths[row, :depth]
        full[row, columns] = full[columns, row] = matrix[row, :depth]
    return full


# inertia of the damper that holds a joint at its limit, relative to the joint's own
_STOP_INERTIA = 1e6
_REVISIONS = 2  # of the set of held joints
# greatest speed at which a joint inside the margin of a limit is returned: bodies with straight
# knees and elbows start there
_RETURN_SPEED_RADPS = 1.0
_SAME_SPEED_RADPS = 1e-4  # difference of joint speeds below which Bullet's are kept


@kernel
def write_torques(
    tree: LinkTree, limits: JointLimits, step_s: float, state: BodyState, forces: JointForces
) -> None:
    """Write the joint torques of the next physics step to `forces.torques`.

    With mass matrix M, bias h, motor torques u, damping D, stiffness K of the motors and the
    external forces f that are predicted, accelerations a solve
    ``(M + dt D + dt^2 K) a = u + f - h - (D + dt K) v``, and the torques are
    ``u - (D + dt K) (v + dt a)``. A joint that would enter the margin of a limit is held by a
    damper that is stiff enough to give it the speed with which it reaches the margin. The joints
    that need it are found by an active-set method, which starts from those of the last step.

    Args:
        tree: The tree of n hinges.
        limits: Limits of angles.
        step_s: Duration dt of the physics step.
        state: The state at its start.
        forces: `drive`, `damping`, `stiffness` and `predicted` are read, the rest is written.
    """
    for revision in range(_REVISIONS + 1):
        _accelerate(tree, limits, step_s, state, forces)
        if revision == _REVISIONS or not _revise(limits, step_s, state, forces):
            break
    for k in range(limits.low.shape[0]):
        i = 6 + k
        speed = state.velocity[i] + step_s * forces.accelerations[i]
        forces.torques[k] = forces.drive[k] - _resistance(k, step_s, forces) * speed
        if forces.held[k] != 0.0:
            stop = _stop_acceleration(k, limits, step_s, state, forces)
            share = _STOP_INERTIA * state.mass_matrix[i, tree.depths[i] - 1]
            forces.torques[k] -= share * (forces.accelerations[i] - stop)


@kernel
def _resistance(k: int, step_s: float, forces: JointForces) -> float:
    """Return by how much the torque of a joint decreases with its speed, N m s/rad."""
    total: float = forces.damping[k] + step_s * forces.stiffness[k]
    return total


@kernel
def _accelerate(
    tree: LinkTree, limits: JointLimits, step_s: float, state: BodyState, forces: JointForces
) -> None:
    """Write the accelerations for the present set of held joints."""
    matrix, right = forces.matrix, forces.accelerations
    for i in range(right.shape[0]):
        right[i] = forces.predicted[i] - state.bias[i]
        for d in range(tree.depths[i]):
            matrix[i, d] = state.mass_matrix[i, d]
    for k in range(limits.low.shape[0]):
        i, last = 6 + k, tree.depths[6 + k] - 1
        resistance = _resistance(k, step_s, forces)
        right[i] += forces.drive[k] - resistance * state.velocity[i]
        if forces.held[k] != 0.0:
            share = _STOP_INERTIA * matrix[i, last]
            matrix[i, last] += share
            right[i] += share * _stop_acceleration(k, limits, step_s, state, forces)
        matrix[i, last] += step_s * resistance
    factorise(tree.depths, tree.paths, matrix)
    solve(tree.depths, tree.paths, matrix, right)


@kernel
def _stop_acceleration(
    k: int, limits: JointLimits, step_s: float, state: BodyState, forces: JointForces
) -> float:
    """Return the acceleration with which a held joint reaches its margin at the end of the step.

    Contacts push joints into the margin. They are returned at no more than `_RETURN_SPEED_RADPS`.
    """
    if forces.held[k] > 0.0:
        stop = limits.high[k] - limits.margin
        speed = max((stop - state.angles[k]) / step_s, -_RETURN_SPEED_RADPS)
    else:
        stop = limits.low[k] + limits.margin
        speed = min((stop - state.angles[k]) / step_s, _RETURN_SPEED_RADPS)
    change: float = speed - state.velocity[6 + k]
    return change / step_s


@kernel
def _revise(limits: JointLimits, step_s: float, state: BodyState, forces: JointForces) -> bool:
    """Hold joints that would enter a margin, release those that pull; return if any changed."""
    changed = False
    for k in range(limits.low.shape[0]):
        acceleration = forces.accelerations[6 + k]
        angle = state.angles[k] + step_s * (state.velocity[6 + k] + step_s * acceleration)
        if forces.held[k] == 0.0:
            if angle > limits.high[k] - limits.margin:
                forces.held[k], changed = 1.0, True
            elif angle < limits.low[k] + limits.margin:
                forces.held[k], changed = -1.0, True
        else:
            stop = _stop_acceleration(k, limits, step_s, state, forces)
            if forces.held[k] * (acceleration - stop) < 0.0:
                forces.held[k], changed = 0.0, True
    return changed


@kernel
def write_speeds(
    tree: LinkTree, step_s: float, solver: SolverState, state: BodyState, forces: JointForces
) -> None:
    """Write speeds of sprung joints after a step to `solver.velocity` and `solver.changed`.

    Bullet's torques are those for the external forces that were predicted. Springs and dampers also
    react on the difference f' - f from the forces that acted: the accelerations of the implicit
    step are ``a + (M + dt D + dt^2 K)^-1 (f' - f)``, where Bullet has ``a + M^-1 (f' - f)``. The
    lower one of the two speeds is taken. Bullet omits a contact point for one step when it has
    drifted, which accelerates light links strongly without this. Joints without stiffness keep
    Bullet's speeds: the correction makes limp bodies less calm (measured, see the page of bodies).

    Args:
        tree: The tree of n hinges.
        step_s: Duration dt of the step.
        solver: Bullet's state after the step.
        state: The state before the step.
        forces: As `write_torques` left them, with `external`, the forces that acted.
    """
    stiffest = 0.0
    for k in range(forces.stiffness.shape[0]):
        stiffest = max(stiffest, forces.stiffness[k])
    if stiffest == 0.0:
        return
    for i in range(forces.scratch.shape[0]):
        forces.scratch[i] = forces.external[i] - forces.predicted[i]
    solve(tree.depths, tree.paths, forces.matrix, forces.scratch)
    for i in range(6, forces.scratch.shape[0]):
        speed = state.velocity[i] + step_s * (forces.accelerations[i] + forces.scratch[i])
        is_held = forces.stiffness[i - 6] > 0.0
        if is_held and abs(speed) < abs(solver.velocity[i]) - _SAME_SPEED_RADPS:
            solver.velocity[i] = speed
            solver.changed[i - 6] = True


@kernel
def write_external_forces(
    tree: LinkTree, step_s: float, solver: SolverState, state: BodyState, forces: JointForces
) -> None:
    """Write the generalised external forces of a step that has ended: weight and all contacts.

    They are ``M (v' - v) / dt + h - torques`` with mass matrix M and bias h at the pose before the
    step.

    Args:
        tree: The tree of n hinges.
        step_s: Duration dt of the step.
        solver: Bullet's state after the step.
        state: The state before the step.
        forces: `torques` are read, `external` is written.
    """
    for i in range(state.velocity.shape[0]):
        forces.scratch[i] = (solver.velocity[i] - state.velocity[i]) / step_s
        forces.external[i] = state.bias[i]
        if i >= 6:
            forces.external[i] -= forces.torques[i - 6]
    add_product(tree.depths, tree.paths, state.mass_matrix, forces.scratch, forces.external)


@kernel
def predict(forces: JointForces) -> None:
    """Predict the external forces of the next step: the mean of those of the last two steps.

    A body that rests on the floor is then predicted to stay at rest, so that dampers do not oppose
    the forces that hold it.
    """
    for i in range(forces.external.shape[0]):
        forces.predicted[i] = 0.5 * (forces.external[i] + forces.before[i])
        forces.before[i] = forces.external[i]

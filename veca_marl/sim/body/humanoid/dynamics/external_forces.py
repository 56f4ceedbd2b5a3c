"""External forces on a body: those of the last physics step, and a prediction for the next one."""

from __future__ import annotations

from numba import njit

from veca_marl.sim.body.humanoid.dynamics.factorisation import add_product
from veca_marl.sim.body.humanoid.dynamics.tree import LinkTree
from veca_marl.sim.body.humanoid.link_tree import BodyState, JointForces, SolverState


@njit(cache=True)
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
    forces.external[:] = state.bias
    forces.external[6:] -= forces.torques
    add_product(tree.depths, tree.paths, state.mass_matrix, forces.scratch, forces.external)


@njit(cache=True)
def predict(forces: JointForces) -> None:
    """Predict the external forces of the next step: the mean of those of the last two steps.

    A body that rests on the floor is then predicted to stay at rest, so that dampers do not oppose
    the forces that hold it.
    """
    for i in range(forces.external.shape[0]):
        forces.predicted[i] = 0.5 * (forces.external[i] + forces.before[i])
    forces.before[:] = forces.external

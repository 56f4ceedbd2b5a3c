"""The state of an articulated body outside of Bullet, and its correction after physics steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from veca_marl.sim.body.humanoid.body_dynamics import (
    FREE,
    TOUCHED,
    UNDECIDED,
    UNKNOWN,
    begin,
    settle,
)
from veca_marl.sim.body.humanoid.dynamics.factorisation import dense, factorise, solve
from veca_marl.sim.body.humanoid.dynamics.tree import LinkTree
from veca_marl.sim.body.humanoid.implicit_torques import write_torques
from veca_marl.sim.body.humanoid.link_tree import (
    BodyState,
    JointForces,
    JointLimits,
    SolverState,
    empty_forces,
    empty_links,
    empty_solver_state,
    empty_state,
)
from veca_marl.sim.geometry import Floats


class BodyDynamics:
    """Mass matrix, momentum, joint limits and joint torques of a body of n hinges.

    Args:
        tree: Masses and frames of its links.
        limits: Limits of its joints.
        damping: ``(n,)`` N m s/rad, of its joints.

    Attributes:
        tree: As given.
        state: Pose and velocity at the last `begin` or `settle`.
        forces: Of the joints: `drive` and `stiffness` are to be written before `torques`.
        solver: What Bullet has after a physics step: to be written before `begin` and `settle`.
    """

    def __init__(self, tree: LinkTree, limits: JointLimits, damping: Floats) -> None:
        self.tree = tree
        self._limits = limits
        depth = tree.paths.shape[1]
        self.state: BodyState = empty_state(tree.hinges, depth)
        self.solver: SolverState = empty_solver_state(tree.hinges)
        self.forces: JointForces = empty_forces(tree.hinges, depth)
        self.forces.damping[:] = damping
        self._links = empty_links(tree.hinges)

    def begin(self) -> None:
        """Take over Bullet's state as it is."""
        begin(self.tree, self.solver, self.state, self._links, self.forces)

    def torques(self, step_s: float) -> Floats:
        """Return the joint torques ``(n,)``, N m, of a physics step, see `implicit_torques`."""
        write_torques(self.tree, self._limits, step_s, self.state, self.forces)
        return self.forces.torques

    def settle(self, step_s: float, weight: Floats, touches_others: Callable[[], bool]) -> int:
        """Correct the state after a physics step, see `settling`.

        Args:
            step_s: Duration of the physics step.
            weight: ``(3,)`` N, weight of the body.
            touches_others: Returns whether the body touches others; called only if the external
                force is no more than the weight, because lists of contacts take time.

        Returns:
            `NEW_POSE` if the pose of the base differs from Bullet's, else `SETTLED`. Joints that
            differ are in `solver.changed`.
        """
        result = self._settle(step_s, weight, UNKNOWN)
        if result == UNDECIDED:
            result = self._settle(step_s, weight, TOUCHED if touches_others() else FREE)
        return result

    def _settle(self, step_s: float, weight: Floats, contact: int) -> int:
        arrays = (self.solver, self.state, self._links, self.forces)
        result: int = settle(self.tree, self._limits, step_s, weight, contact, *arrays)
        return result

    # ---- what follows from the state

    def mass_matrix(self) -> Floats:
        """Return the mass matrix ``(6 + n, 6 + n)``."""
        return dense(self.tree.depths, self.tree.paths, self.state.mass_matrix)

    def solve_with(self, added_inertia: Floats, forces: Floats) -> Floats:
        """Return accelerations ``(6 + n,)`` for generalised forces.

        Args:
            added_inertia: ``(n,)`` kg m^2, added to the hinges' diagonal of the mass matrix.
            forces: ``(6 + n,)`` N m and N.
        """
        matrix, found = self.state.mass_matrix.copy(), forces.copy()
        depths, paths = self.tree.depths, self.tree.paths
        matrix[np.arange(6, len(matrix)), depths[6:] - 1] += added_inertia
        factorise(depths, paths, matrix)
        solve(depths, paths, matrix, found)
        return found

    def kinetic_energy(self) -> float:
        """Return the kinetic energy, J."""
        velocity = self.state.velocity
        return 0.5 * float(velocity @ self.mass_matrix() @ velocity)

    def inertia_about_centre(self) -> Floats:
        """Return the moment of inertia ``(3, 3)`` about the centre of mass, world axes, kg m^2."""
        centre, mass = self.state.centre, float(self.tree.masses.sum())
        shift = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        matrix: Floats = self.mass_matrix()[:3, :3] - shift
        return matrix

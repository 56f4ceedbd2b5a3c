"""The state of an articulated body outside of Bullet, and its correction after physics steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.humanoid.dynamics.factorisation import factorise, solve
from veca_marl.sim.body.humanoid.dynamics.settling import (
    settle,
    update_bias,
    update_inertia,
    write_external_impulse,
    write_momentum,
)
from veca_marl.sim.body.humanoid.dynamics.state import (
    BodyState,
    SolverState,
    empty_links,
    empty_solver_state,
    empty_state,
)
from veca_marl.sim.body.humanoid.dynamics.tree import LinkTree
from veca_marl.sim.geometry import Floats, quaternions_to_matrices


class BodyDynamics:
    """Mass matrix, momentum and joint limits of a body of n hinges.

    Args:
        tree: Masses and frames of its links.
        low: ``(n,)`` rad, lower joint limits.
        high: ``(n,)`` rad, upper joint limits.
        top_speed_radps: Limit of joint speeds.

    Attributes:
        tree: As given.
        state: Pose and velocity at the last `begin` or `settle`.
        solver: What Bullet has after a physics step: to be written before `begin` and `settle`.
    """

    def __init__(self, tree: LinkTree, low: Floats, high: Floats, top_speed_radps: float) -> None:
        self.tree = tree
        self._low, self._high = low, high
        self._top_speed = top_speed_radps
        self.state: BodyState = empty_state(tree.hinges)
        self.solver: SolverState = empty_solver_state(tree.hinges)
        self._links = empty_links(tree.hinges)
        self._changed = np.zeros(tree.hinges)

    def begin(self, position: Floats) -> None:
        """Take over Bullet's state as it is.

        Args:
            position: ``(3,)`` metres, Bullet's position of the base.
        """
        state, solver = self.state, self.solver
        state.position[:] = position
        quaternions_to_matrices(solver.quaternion[None], state.rotation[None])
        state.angles[:], state.velocity[:] = solver.angles, solver.velocity
        update_inertia(self.tree, state, self._links)
        update_bias(self.tree, state, self._links)
        write_momentum(state)

    def external_impulse(self, step_s: float) -> Floats:
        """Return the impulse ``(6,)`` of external forces in a physics step that has ended.

        N m s about the centre of mass, then N s.
        """
        impulse = np.empty(6)
        write_external_impulse(step_s, self.solver, self.state, impulse)
        return impulse

    def settle(self, step_s: float, impulse: Floats) -> NDArray[np.int64]:
        """Correct the state after a physics step, see `settling`.

        Args:
            step_s: Duration of the physics step.
            impulse: ``(6,)``, that of external forces.

        Returns:
            The indices of the hinges with an angle or speed that differs from Bullet's.
        """
        settle(
            self.tree,
            self._low,
            self._high,
            self._top_speed,
            step_s,
            impulse,
            self.solver,
            self.state,
            self._links,
            self._changed,
        )
        return self._changed.nonzero()[0]

    # ---- what follows from the state

    def solve_with(self, added_inertia: Floats, forces: Floats) -> Floats:
        """Return accelerations ``(6 + n,)`` for generalised forces.

        Args:
            added_inertia: ``(n,)`` kg m^2, added to the hinges' diagonal of the mass matrix.
            forces: ``(6 + n,)`` N m and N.
        """
        matrix, found = self.state.mass_matrix.copy(), forces.copy()
        hinges = np.arange(6, len(matrix))
        matrix[hinges, hinges] += added_inertia
        factorise(self.tree.previous_rows, matrix)
        solve(self.tree.previous_rows, matrix, found)
        return found

    def kinetic_energy(self) -> float:
        """Return the kinetic energy, J."""
        velocity = self.state.velocity
        return 0.5 * float(velocity @ self.state.mass_matrix @ velocity)

    def inertia_about_centre(self) -> Floats:
        """Return the moment of inertia ``(3, 3)`` about the centre of mass, world axes, kg m^2."""
        centre, mass = self.state.centre, float(self.tree.masses.sum())
        shift = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        matrix: Floats = self.state.mass_matrix[:3, :3] - shift
        return matrix

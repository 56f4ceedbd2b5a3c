"""The state of an articulated body outside of Bullet, and its correction after physics steps.

Bullet stores joint angles and speeds in which the momentum of a free body drifts: its integrator
uses the accelerations of the old pose at the new one, and joint angles that are set back to their
limits move the body's centre of mass. The external impulse of the step is known nevertheless: it
is what the base's six rows of Newton's law, evaluated at the pose before the step, leave over. So
momentum and angular momentum after the step are known, and base pose and base velocity follow from
them and from the joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from veca_marl.sim.body.humanoid.bone_ends import BoneEnds, excess_m
from veca_marl.sim.body.humanoid.implicit_torques import (
    add_product,
    dense,
    factorise,
    predict,
    solve,
    write_external_forces,
    write_speeds,
    write_torques,
)
from veca_marl.sim.body.humanoid.inertial_forces import (
    add_cross,
    locate_links,
    write_bias,
    write_mass_matrix,
)
from veca_marl.sim.body.humanoid.link_tree import (
    BodyState,
    JointForces,
    JointLimits,
    LinkArrays,
    LinkTree,
    SolverState,
    empty_forces,
    empty_links,
    empty_solver_state,
    empty_state,
)
from veca_marl.sim.geometry import Floats, quaternions_to_matrices
from veca_marl.sim.kernels import kernel

# impulse on the whole body in a physics step below which nothing may touch it; its weight gives
# 0.8 N s
_NO_FORCE_NS = 1e-3
_SAME_PLACE_M = 5e-7  # distance from Bullet's position of the base below which Bullet keeps it

# what is known of contacts with other bodies
UNKNOWN, TOUCHED, FREE = 0, 1, 2
# results of `settle`
SETTLED, NEW_POSE, UNDECIDED = 0, 1, 2


@kernel
def begin(
    tree: LinkTree, solver: SolverState, state: BodyState, links: LinkArrays, forces: JointForces
) -> None:
    """Take over Bullet's state; the forces of earlier steps are set to 0."""
    for i in range(3):
        state.position[i] = solver.position[i]
    for i in range(state.velocity.shape[0]):
        state.velocity[i] = solver.velocity[i]
    _take_over_pose(tree, solver, state, links)
    write_bias(tree, links, state.velocity, state.bias)
    forces.scratch[:] = 0.0
    add_product(tree.depths, tree.paths, state.mass_matrix, state.velocity, forces.scratch)
    for i in range(6):
        state.momentum[i] = forces.scratch[i]
    add_cross(state.momentum[3:], state.centre, state.momentum[:3])
    forces.predicted[:], forces.before[:] = 0.0, 0.0
    forces.torques[:], forces.held[:] = 0.0, 0.0


@kernel
def _take_over_pose(
    tree: LinkTree, solver: SolverState, state: BodyState, links: LinkArrays
) -> None:
    """Take over Bullet's joint angles and orientation, and write links and masses in that pose."""
    quaternions_to_matrices(solver.quaternion.reshape(1, 4), state.rotation.reshape(1, 3, 3))
    for k in range(state.angles.shape[0]):
        state.angles[k] = solver.angles[k]
    locate_links(tree, state.rotation, state.angles, links)
    write_mass_matrix(tree, links, state.centre, state.mass_matrix)


@kernel
def settle(
    tree: LinkTree,
    limits: JointLimits,
    ends: BoneEnds,
    step_s: float,
    weight: Floats,
    contact: int,
    solver: SolverState,
    state: BodyState,
    links: LinkArrays,
    forces: JointForces,
) -> int:
    """Apply joint limits to the state after a step and give the base the momentum that it has.

    If a bone is deeper in the floor than `DEEPEST_M` then, the body is raised.

    Args:
        tree: The tree of n hinges.
        limits: Limits of angles and speeds.
        ends: The ends of the bones.
        step_s: Duration of the physics step.
        weight: ``(3,)`` N, weight of the body.
        contact: `TOUCHED` or `FREE` if it is known whether another body is touched, or `UNKNOWN`.
        solver: Bullet's state after the step; angles, joint speeds and orientation are overwritten,
            `changed` is written.
        state: The state before the step; overwritten by the one after it.
        links: The links before the step; overwritten.
        forces: `torques` are read, `external` and `predicted` are written.

    Returns:
        `UNDECIDED` if `contact` is `UNKNOWN` and the external force is no more than the weight: the
        state is unchanged then, and contacts have to be looked for. Otherwise whether the pose of
        the base differs from Bullet's: `NEW_POSE` or `SETTLED`. Its velocity always differs;
        `solver.changed` has the joints that differ.
    """
    write_external_forces(tree, step_s, solver, state, forces)
    if not _add_impulse(step_s, weight, contact, forces, state):
        return UNDECIDED
    solver.changed[:] = False
    write_speeds(tree, step_s, solver, state, forces)
    predict(forces)
    mass = np.sum(tree.masses)
    for i in range(3):  # the new centre of mass, until the new pose is known
        state.position[i] = (
            state.position[i] + state.centre[i] + step_s * state.momentum[3 + i] / mass
        )
    turned = _apply_limits(limits, state.mass_matrix, solver)
    if turned:
        _turn_base(tree, state.mass_matrix, forces.matrix, solver)
    _take_over_pose(tree, solver, state, links)
    moved = _place_base(ends, links, solver, state)
    _write_velocity(tree, state, solver.velocity, forces)
    write_bias(tree, links, state.velocity, state.bias)
    return NEW_POSE if turned or moved else SETTLED


@kernel
def _place_base(ends: BoneEnds, links: LinkArrays, solver: SolverState, state: BodyState) -> bool:
    """Replace `state.position`, the centre of mass, by the position of the base.

    Returns:
        Whether it differs from Bullet's.
    """
    for i in range(3):
        state.position[i] -= state.centre[i]
    state.position[2] += excess_m(ends, links, state.position[2])
    moved = False
    for i in range(3):
        moved = moved or abs(state.position[i] - solver.position[i]) > _SAME_PLACE_M
    return moved


@kernel
def _add_impulse(
    step_s: float, weight: Floats, contact: int, forces: JointForces, state: BodyState
) -> bool:
    """Add the impulse of external forces to the momentum; return false if contacts are unknown.

    Bullet applies the two friction forces of a contact of the body with itself at points that
    differ by the penetration. The torque that remains is dropped where no other body is touched.
    """
    impulse, external, square = forces.scratch[:6], forces.external, 0.0
    for i in range(3):
        impulse[i], impulse[3 + i] = 0.0, step_s * weight[i]
        square += (step_s * (external[3 + i] - weight[i])) ** 2
    if contact == UNKNOWN and square < _NO_FORCE_NS**2:
        return False
    if contact != FREE:
        for i in range(6):
            impulse[i] = step_s * external[i]
        add_cross(impulse[3:], state.centre, impulse[:3])
    for i in range(6):
        state.momentum[i] += impulse[i]
    return True


@kernel
def _apply_limits(limits: JointLimits, mass_matrix: Floats, solver: SolverState) -> bool:
    """Clip angles and joint speeds; return whether an angle was clipped.

    For each change of an angle the impulse that an internal motor would leave on the base is added
    to the base's turn.
    """
    turned = False
    solver.turn[:] = 0.0
    for joint in range(limits.low.shape[0]):
        angle = min(max(solver.angles[joint], limits.low[joint]), limits.high[joint])
        speed = min(max(solver.velocity[6 + joint], -limits.speed), limits.speed)
        if speed != solver.velocity[6 + joint]:
            solver.velocity[6 + joint] = speed
            solver.changed[joint] = True
        if angle != solver.angles[joint]:
            for i in range(6):
                solver.turn[i] -= mass_matrix[6 + joint, i] * (angle - solver.angles[joint])
            solver.angles[joint] = angle
            solver.changed[joint], turned = True, True
    return turned


@kernel
def _turn_base(tree: LinkTree, mass_matrix: Floats, block: Floats, solver: SolverState) -> None:
    """Rotate the base by as much as it reacts on the changes of angles."""
    _solve_base(tree, mass_matrix, block, solver.turn)
    turn, q = solver.turn, solver.quaternion
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    share = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    a, b, c, w = share * turn[0], share * turn[1], share * turn[2], math.cos(0.5 * angle)
    x, y, z = q[0], q[1], q[2]
    q[0] = w * x + a * q[3] + b * z - c * y
    q[1] = w * y + b * q[3] + c * x - a * z
    q[2] = w * z + c * q[3] + a * y - b * x
    q[3] = w * q[3] - a * x - b * y - c * z


@kernel
def _solve_base(tree: LinkTree, mass_matrix: Floats, block: Floats, x: Floats) -> None:
    """Replace a right side ``(6,)`` by the solution with the base's block of the mass matrix.

    The first rows of `block` are overwritten by its factor.
    """
    for i in range(6):
        for j in range(i + 1):
            block[i, j] = mass_matrix[i, j]
    factorise(tree.depths[:6], tree.paths[:6], block)
    solve(tree.depths[:6], tree.paths[:6], block, x)


@kernel
def _write_velocity(
    tree: LinkTree, state: BodyState, velocity: Floats, forces: JointForces
) -> None:
    """Write the velocity of the base that gives the body its momentum at the new pose."""
    base = forces.scratch[:6]
    for i in range(6):
        base[i] = state.momentum[i]
    add_cross(state.centre, state.momentum[3:], base[:3])
    for j in range(6, velocity.shape[0]):
        for i in range(6):
            base[i] -= state.mass_matrix[j, i] * velocity[j]
    _solve_base(tree, state.mass_matrix, forces.matrix, base)
    for i in range(velocity.shape[0]):
        state.velocity[i] = base[i] if i < 6 else velocity[i]


class BodyDynamics:
    """Mass matrix, momentum, joint limits and joint torques of a body of n hinges.

    Args:
        tree: Masses and frames of its links.
        limits: Limits of its joints.
        ends: The ends of its bones.
        damping: ``(n,)`` N m s/rad, of its joints.

    Attributes:
        tree: As given.
        state: Pose and velocity at the last `begin` or `settle`.
        forces: Of the joints: `drive` and `stiffness` are to be written before `torques`.
        solver: What Bullet has after a physics step: to be written before `begin` and `settle`.
    """

    def __init__(
        self, tree: LinkTree, limits: JointLimits, ends: BoneEnds, damping: Floats
    ) -> None:
        self.tree = tree
        self._limits, self._ends = limits, ends
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
        result: int = settle(
            self.tree,
            self._limits,
            self._ends,
            step_s,
            weight,
            contact,
            self.solver,
            self.state,
            self._links,
            self.forces,
        )
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

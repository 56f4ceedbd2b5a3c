"""The body as a tree of rigid links on hinges with a free base, and the arrays of its state.

Conventions of the dynamics (Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008): all
vectors have world axes. A spatial vector is ``(angular, linear)``, its linear part taken at the
reference point, which is the base's centre of mass; the generalised velocity is ``(angular velocity
of the base, velocity of its centre of mass, joint speeds)``. Link 0 is the base, link i hangs on
joint i - 1, and parents precede their children.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Inertia, Pose, joined_inertia
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet


class LinkScratch(NamedTuple):
    """Arrays that the functions of a tree of n hinges overwrite: they allocate none.

    Attributes:
        masses: ``(n + 1,)`` kg, of a link and all that hangs on it.
        moments: ``(n + 1, 3)`` kg m, of these.
        inertias: ``(n + 1, 3, 3)`` kg m^2, of these.
        motion: ``(n + 1, 6)`` spatial velocities.
        change: ``(n + 1, 6)`` spatial accelerations without those of the hinges.
        force: ``(n + 1, 6)`` spatial forces.
        turned: ``(3, 3)`` a rotation or an inertia.
        centre: ``(3,)`` metres, the centre of mass of a link.
        six: ``(2, 6)`` spatial vectors.
    """

    masses: Floats
    moments: Floats
    inertias: Floats
    motion: Floats
    change: Floats
    force: Floats
    turned: Floats
    centre: Floats
    six: Floats


class LinkArrays(NamedTuple):
    """Where the links of a tree of n hinges are; written by `locate_links`.

    Attributes:
        rotations: ``(n + 1, 3, 3)`` from the links' frames to the world.
        origins: ``(n + 1, 3)`` metres from the reference point.
        hinges: ``(n, 6)`` spatial velocity of each link for 1 rad/s of its hinge.
        moments: ``(n + 1, 3)`` kg m, mass times centre of mass from the reference point.
        inertias: ``(n + 1, 3, 3)`` kg m^2 about the reference point, world axes.
        scratch: Overwritten.
    """

    rotations: Floats
    origins: Floats
    hinges: Floats
    moments: Floats
    inertias: Floats
    scratch: LinkScratch


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
        scratch=LinkScratch(
            masses=np.zeros(hinges + 1),
            moments=np.zeros((hinges + 1, 3)),
            inertias=np.zeros((hinges + 1, 3, 3)),
            motion=np.zeros((hinges + 1, 6)),
            change=np.zeros((hinges + 1, 6)),
            force=np.zeros((hinges + 1, 6)),
            turned=np.zeros((3, 3)),
            centre=np.zeros(3),
            six=np.zeros((2, 6)),
        ),
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


class LinkTree(NamedTuple):
    """Constants of a tree of n hinges. Links that are fixed to each other are one link.

    Attributes:
        parents: ``(n + 1,)`` parent link; -1 for the base.
        depths: ``(6 + n,)`` number of rows on the way from row 0 of the mass matrix to each row,
            both included.
        paths: ``(6 + n, depth)`` those rows in this order; -1 after the row itself.
        positions: ``(n + 1, 3)`` metres, the joint's position in the parent's frame.
        rotations: ``(n + 1, 3, 3)`` orientation in the parent's frame at angle 0.
        axes: ``(n + 1, 3)`` axis of the joint in the link's frame.
        masses: ``(n + 1,)`` kg.
        centres: ``(n + 1, 3)`` metres, centre of mass in the link's frame.
        inertias: ``(n + 1, 3, 3)`` kg m^2 about the centre of mass, in the link's frame.
    """

    parents: NDArray[np.int64]
    depths: NDArray[np.int64]
    paths: NDArray[np.int64]
    positions: Floats
    rotations: Floats
    axes: Floats
    masses: Floats
    centres: Floats
    inertias: Floats

    @property
    def hinges(self) -> int:
        """Number of hinges."""
        return len(self.parents) - 1


def read_tree(client: BulletClient, body_id: int) -> LinkTree:
    """Read the tree of a body from Bullet, so that both have the same masses and frames.

    Args:
        client: The PyBullet client.
        body_id: A body with all joints at 0; its base's inertia is diagonal in the base's frame.
    """
    groups = _rigid_groups(_links(client, body_id))
    heads = [group[0] for group in groups]
    row_of = _rows(groups)
    parents = [-1] + [row_of[head.parent] for head in heads[1:]]
    frames = [head.frame for head in heads]
    merged = [_merged(group) for group in groups]
    relative = [frames[0]] + [
        _seen_from(frames[parent], frame)
        for parent, frame in zip(parents[1:], frames[1:], strict=True)
    ]
    depths, paths = _paths(parents)
    return LinkTree(
        parents=np.array(parents),
        depths=depths,
        paths=paths,
        positions=np.array([pose.position for pose in relative]),
        rotations=np.array([pose.rotation for pose in relative]),
        axes=np.array([head.axis for head in heads]),
        masses=np.array([whole.mass_kg for whole in merged]),
        centres=np.array([whole.centre for whole in merged]),
        inertias=np.array([whole.matrix for whole in merged]),
    )


def link_rows(client: BulletClient, body_id: int) -> dict[int, int]:
    """Return the link of the tree that each of Bullet's links belongs to; -1 is the base."""
    return _rows(_rigid_groups(_links(client, body_id)))


def _rows(groups: list[list[_Link]]) -> dict[int, int]:
    return {link.number: i for i, group in enumerate(groups) for link in group}


def _paths(parents: list[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return `depths` and `paths` of a tree: the base has rows 0 to 5, link i has row i + 5."""
    rows = [list(range(i + 1)) for i in range(6)]
    for link, parent in enumerate(parents[1:], 1):
        rows.append([*rows[5 + parent], 5 + link])
    depths = np.array([len(row) for row in rows])
    paths = np.full((len(rows), int(depths.max())), -1)
    for row, path in zip(rows, paths, strict=True):
        path[: len(row)] = row
    return depths, paths


class _Link(NamedTuple):
    """A link in Bullet: `frame` and `inertial` are in the world, `axis` is in `frame`."""

    number: int
    parent: int
    is_hinge: bool
    frame: Pose
    inertial: Pose
    axis: Floats
    mass_kg: float
    moments: Floats


def _links(client: BulletClient, body_id: int) -> list[_Link]:
    """Return the base and all links in Bullet's order, in which parents precede their children."""
    place, turn = client.getBasePositionAndOrientation(body_id)
    base = Pose(np.array(place), _matrix(turn))
    dynamics = client.getDynamicsInfo(body_id, -1)
    mass, moments = dynamics.mass_kg, np.array(dynamics.moments)
    found = [_Link(-1, -2, True, base, base, np.zeros(3), mass, moments)]
    for index in range(client.getNumJoints(body_id)):
        info = client.getJointInfo(body_id, index)
        state = client.getLinkState(body_id, index, 0, 1)
        inertial = Pose(np.array(state.centre), _matrix(state.centre_orientation))
        frame = Pose(np.array(state.position), _matrix(state.orientation))
        # Bullet gives the axis in the frame of the principal axes
        axis = frame.rotation.T @ inertial.rotation @ np.array(info.axis)
        dynamics = client.getDynamicsInfo(body_id, index)
        is_hinge = info.kind == pybullet.JOINT_REVOLUTE
        mass, moments = dynamics.mass_kg, np.array(dynamics.moments)
        found.append(_Link(index, info.parent, is_hinge, frame, inertial, axis, mass, moments))
    return found


def _rigid_groups(links: list[_Link]) -> list[list[_Link]]:
    """Return the links that move as one; the first of each group is on a hinge, or is the base."""
    groups: list[list[_Link]] = []
    row_of: dict[int, int] = {}
    for link in links:
        if link.is_hinge:
            row_of[link.number] = len(groups)
            groups.append([link])
        else:
            row_of[link.number] = row_of[link.parent]
            groups[row_of[link.number]].append(link)
    return groups


def _merged(group: list[_Link]) -> Inertia:
    """Return the inertia of a rigid group in the frame of its first link."""
    parts = []
    for link in group:
        pose = _seen_from(group[0].frame, link.inertial)
        parts.append((pose, Inertia(link.mass_kg, np.zeros(3), np.diag(link.moments))))
    return joined_inertia(parts)


def _seen_from(frame: Pose, pose: Pose) -> Pose:
    """Return a pose of the world in a frame."""
    back = frame.rotation.T
    return Pose(back @ (pose.position - frame.position), back @ pose.rotation)


def _matrix(quaternion: Any) -> Floats:
    return np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)

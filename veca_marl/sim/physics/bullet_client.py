"""PyBullet, imported without its message about its build; its clients, and names for its tuples.

Only this module passes `physicsClientId` and knows the order of the entries of Bullet's tuples.
PyBullet Quickstart Guide: https://docs.google.com/document/d/10sXEhzFRSnvFcl3XxNGhnD4N2SedqwdAvK3dsihxVUA
"""

from __future__ import annotations

import inspect
import os
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import starmap
from typing import TYPE_CHECKING, Any, NamedTuple, cast


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """Turn file descriptor 2 away: the line is printed in C, past `sys.stderr`."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


with _silent_stderr():
    import pybullet

__all__ = [
    "BulletClient",
    "ContactPoint",
    "DynamicsInfo",
    "JointInfo",
    "JointState",
    "LinkState",
    "RayHit",
    "pybullet",
]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""(x, y, z, w)."""

_NOT_COMPUTED: Vector = (float("nan"),) * 3


class ContactPoint(NamedTuple):
    """A point at which two bodies touch or are near each other. Vectors have world axes.

    Attributes:
        flag: Not used by Bullet.
        body_a: Bullet's id of one body.
        body_b: That of the other.
        link_a: Link of `body_a`; -1 is the base.
        link_b: Link of `body_b`.
        position_on_a: ``(3,)`` metres.
        position_on_b: ``(3,)`` metres.
        normal_on_b: ``(3,)`` unit vector from `body_b` to `body_a`.
        distance_m: Positive if they are apart, negative if they penetrate each other.
        normal_force_n: In the last physics step; 0 for closest points.
        friction_1_n: Lateral friction force along `friction_direction_1`.
        friction_direction_1: ``(3,)`` unit vector.
        friction_2_n: Lateral friction force along `friction_direction_2`.
        friction_direction_2: ``(3,)`` unit vector.
    """

    flag: int
    body_a: int
    body_b: int
    link_a: int
    link_b: int
    position_on_a: Vector
    position_on_b: Vector
    normal_on_b: Vector
    distance_m: float
    normal_force_n: float
    friction_1_n: float
    friction_direction_1: Vector
    friction_2_n: float
    friction_direction_2: Vector


class JointInfo(NamedTuple):
    """A joint as it was built.

    Units of joints are rad and N m for hinges, metres and N for slides.

    Attributes:
        joint: Its index, and that of the link that it moves.
        name: In the URDF.
        kind: Such as `pybullet.JOINT_REVOLUTE`.
        position_row: First row in the positions of the body; -1 for a fixed joint.
        velocity_row: First row in the velocities of the body; -1 for a fixed joint.
        flags: Reserved by Bullet.
        damping: N m s/rad or N s/m.
        friction: Coulomb friction.
        lower_limit: Of its coordinate.
        upper_limit: Of its coordinate.
        max_force: In the URDF.
        max_velocity: In the URDF, rad/s or m/s.
        link_name: Name of its link in the URDF.
        axis: ``(3,)`` in the inertial frame of its link.
        parent_position: ``(3,)`` metres, of the joint in the inertial frame of the parent link.
        parent_orientation: ``(4,)`` likewise.
        parent: Index of the parent link; -1 is the base.
    """

    joint: int
    name: bytes
    kind: int
    position_row: int
    velocity_row: int
    flags: int
    damping: float
    friction: float
    lower_limit: float
    upper_limit: float
    max_force: float
    max_velocity: float
    link_name: bytes
    axis: Vector
    parent_position: Vector
    parent_orientation: Quaternion
    parent: int


class JointState(NamedTuple):
    """The state of a joint with one degree of freedom.

    Attributes:
        position: rad or metres.
        velocity: rad/s or m/s.
        reaction: ``(6,)`` forces (N) and torques (N m); 0 unless a sensor is enabled.
        motor_force: N m or N, applied by its motor in the last physics step.
    """

    position: float
    velocity: float
    reaction: tuple[float, float, float, float, float, float]
    motor_force: float


class LinkState(NamedTuple):
    """Where a link is, and how it moves.

    Attributes:
        centre: ``(3,)`` metres, world frame: its centre of mass.
        centre_orientation: ``(4,)`` of its inertial frame in the world.
        local_centre: ``(3,)`` metres, its centre of mass in its own frame.
        local_orientation: ``(4,)`` of its inertial frame in its own frame.
        position: ``(3,)`` metres, world frame: the origin of its own frame.
        orientation: ``(4,)`` of its own frame in the world.
        velocity: ``(3,)`` m/s of its centre of mass; NaN unless it was asked for.
        angular_velocity: ``(3,)`` rad/s, world axes; NaN unless it was asked for.
    """

    centre: Vector
    centre_orientation: Quaternion
    local_centre: Vector
    local_orientation: Quaternion
    position: Vector
    orientation: Quaternion
    velocity: Vector = _NOT_COMPUTED
    angular_velocity: Vector = _NOT_COMPUTED


class DynamicsInfo(NamedTuple):
    """Mass and contact parameters of a link.

    Attributes:
        mass_kg: 0 for what is fixed.
        lateral_friction: Coefficient of friction.
        moments: ``(3,)`` kg m^2, the diagonal of the inertia in the inertial frame.
        local_centre: ``(3,)`` metres, the centre of mass in the frame of the link.
        local_orientation: ``(4,)`` of the inertial frame in the frame of the link.
        restitution: Coefficient of restitution.
        rolling_friction: Orthogonal to the contact normal.
        spinning_friction: Around the contact normal.
        contact_damping: -1 if it was not set.
        contact_stiffness: -1 if it was not set.
        body_type: 1 rigid body, 2 multibody, 3 soft body.
        collision_margin_m: Of its collision shape.
    """

    mass_kg: float
    lateral_friction: float
    moments: Vector
    local_centre: Vector
    local_orientation: Quaternion
    restitution: float
    rolling_friction: float
    spinning_friction: float
    contact_damping: float
    contact_stiffness: float
    body_type: int
    collision_margin_m: float


class RayHit(NamedTuple):
    """What a ray hits.

    Attributes:
        body_id: Bullet's id of the body; -1 if the ray hits nothing.
        link: Link of the body; -1 is the base.
        fraction: Of the ray, up to the hit, in [0, 1].
        position: ``(3,)`` metres, world frame.
        normal: ``(3,)`` unit vector, world frame, of the surface.
    """

    body_id: int
    link: int
    fraction: float
    position: Vector
    normal: Vector


# without the check of the length by `_make`, which takes half as long as reading the points
_contact_point = cast(Callable[[Any], ContactPoint], partial(tuple.__new__, ContactPoint))
_FUNCTIONS = {
    name: function
    for name, function in vars(pybullet).items()
    if inspect.isbuiltin(function) and name not in ("connect", "disconnect")
}


class BulletClient:
    """A client of PyBullet: Bullet's functions under their own names, for its own physics world.

    ``client.getAABB(body_id, link)`` is ``pybullet.getAABB(body_id, link, physicsClientId=...)``.
    What is defined below returns tuples with names; all others return what Bullet does. The latter
    are bound once, since looking each up at its call would take longer.

    A client that is no longer referenced disconnects by itself: PyBullet has a limited number of
    them. `physicsClientId` of PyBullet's functions accepts it, too.

    Attributes:
        id: PyBullet's number of the client; -1 after `close`.
    """

    def __init__(self) -> None:
        self._bind(pybullet.connect(pybullet.DIRECT))
        self._disconnect = weakref.finalize(self, pybullet.disconnect, physicsClientId=self.id)

    def __index__(self) -> int:
        return self.id

    def close(self) -> None:
        """Disconnect; every later call raises `pybullet.error`. Closing twice is harmless.

        PyBullet gives the number of a closed client to the next one, which must not be changed.
        """
        self._disconnect()
        self._bind(-1)

    def _bind(self, number: int) -> None:
        """Let all functions act on the client with a number."""
        self.id = number
        for name, function in _FUNCTIONS.items():
            if name not in vars(BulletClient):
                setattr(self, name, partial(function, physicsClientId=number))

    if TYPE_CHECKING:  # PyBullet has no type information

        def __getattr__(self, name: str) -> Any: ...

    def gravity(self) -> tuple[float, float, float]:
        """Return the present gravity along x, y and z, m/s^2."""
        world = self.getPhysicsEngineParameters()
        x, y, z = (float(world[f"gravityAcceleration{axis}"]) for axis in "XYZ")
        return x, y, z

    def getContactPoints(self, bodyA: int = -1, bodyB: int = -1) -> tuple[ContactPoint, ...]:
        """Return the contact points of the last physics step, of one or two bodies or of all."""
        points = pybullet.getContactPoints(bodyA, bodyB, physicsClientId=self.id)
        return tuple(map(_contact_point, points))

    def getClosestPoints(
        self, bodyA: int, bodyB: int, distance: float, linkIndexA: int = -2, linkIndexB: int = -2
    ) -> tuple[ContactPoint, ...]:
        """Return the closest points of two bodies that are within a distance in metres."""
        points = pybullet.getClosestPoints(
            bodyA, bodyB, distance, linkIndexA, linkIndexB, physicsClientId=self.id
        )
        return tuple(map(_contact_point, points))

    def rayTest(
        self, rayFromPosition: Sequence[float], rayToPosition: Sequence[float]
    ) -> tuple[RayHit, ...]:
        """Return the first thing that a ray hits, as the only entry."""
        hits = pybullet.rayTest(rayFromPosition, rayToPosition, physicsClientId=self.id)
        return tuple(map(RayHit._make, hits))

    def rayTestBatch(
        self,
        rayFromPositions: Sequence[Sequence[float]],
        rayToPositions: Sequence[Sequence[float]],
        reportHitNumber: int = -1,
    ) -> tuple[RayHit, ...]:
        """Return what each of several rays hits first.

        With a `reportHitNumber` of 0 or more it is one of all things on the ray, in Bullet's order,
        which is not that of their distance.
        """
        hits = pybullet.rayTestBatch(
            rayFromPositions,
            rayToPositions,
            reportHitNumber=reportHitNumber,
            physicsClientId=self.id,
        )
        return tuple(map(RayHit._make, hits))

    def getJointInfo(self, bodyUniqueId: int, jointIndex: int) -> JointInfo:
        """Return how a joint was built."""
        info = pybullet.getJointInfo(bodyUniqueId, jointIndex, physicsClientId=self.id)
        return JointInfo._make(info)

    def getJointState(self, bodyUniqueId: int, jointIndex: int) -> JointState:
        """Return the state of a joint."""
        state = pybullet.getJointState(bodyUniqueId, jointIndex, physicsClientId=self.id)
        return JointState._make(state)

    def getLinkState(
        self,
        bodyUniqueId: int,
        linkIndex: int,
        computeLinkVelocity: int = 0,
        computeForwardKinematics: int = 0,
    ) -> LinkState:
        """Return where a link is; with `computeLinkVelocity` also how it moves.

        `computeForwardKinematics` updates what has been set since the last physics step.
        """
        state = pybullet.getLinkState(
            bodyUniqueId,
            linkIndex,
            computeLinkVelocity,
            computeForwardKinematics,
            physicsClientId=self.id,
        )
        return LinkState(*state)

    def getLinkStates(
        self,
        bodyUniqueId: int,
        linkIndices: Sequence[int],
        computeLinkVelocity: int = 0,
        computeForwardKinematics: int = 0,
    ) -> tuple[LinkState, ...]:
        """Return where several links of a body are, see `getLinkState`."""
        states = pybullet.getLinkStates(
            bodyUniqueId,
            linkIndices,
            computeLinkVelocity,
            computeForwardKinematics,
            physicsClientId=self.id,
        )
        return tuple(starmap(LinkState, states))

    def getDynamicsInfo(self, bodyUniqueId: int, linkIndex: int) -> DynamicsInfo:
        """Return mass and contact parameters of a link."""
        info = pybullet.getDynamicsInfo(bodyUniqueId, linkIndex, physicsClientId=self.id)
        return DynamicsInfo._make(info)

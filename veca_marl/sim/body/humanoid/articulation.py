"""The articulated bones in Bullet: their state, their torques and their joint limits."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Build, Skeleton, body_files, bone_of
from veca_marl.sim.body.humanoid.self_collision import allow_self_collision
from veca_marl.sim.geometry import (
    Floats,
    Pose,
    cross,
    matrix_to_quaternion,
    quaternions_to_matrices,
)
from veca_marl.sim.physics import pybullet

_TOP_SPEED = 30.0  # rad/s of a joint and m/s of the body: twice the speed of human limbs
_FLAGS = (
    pybullet.URDF_USE_INERTIA_FROM_FILE
    | pybullet.URDF_MAINTAIN_LINK_ORDER
    | pybullet.URDF_USE_SELF_COLLISION
    | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
)


class Motion(NamedTuple):
    """Pose and velocity of the pelvis.

    Attributes:
        pose: Its frame in the world.
        velocity: ``(3,)`` m/s of the frame's origin.
        angular_velocity: ``(3,)`` rad/s, world axes.
    """

    pose: Pose
    velocity: Floats
    angular_velocity: Floats


class Articulation:
    """A skeleton as one multibody in Bullet.

    Joints are numbered as in the skeleton's table; fixed joints stay at 0.

    Args:
        client: The PyBullet client.
        skeleton: The table of bones and joints.
        build: Which joints move, and their strength and friction.

    Attributes:
        body_id: Bullet's id.
        moving: ``(n,)`` indices of the joints that move, ascending.
        angles: ``(82,)`` rad, at the last `read` or `place`.
        speeds: ``(82,)`` rad/s.
        strengths_nm: ``(82,)`` N m, the greatest torque of each joint; 0 for fixed joints.
        damping: ``(82,)`` N m s/rad.
    """

    def __init__(self, client: int, skeleton: Skeleton, build: Build) -> None:
        self._client = client
        self.body_id = _load(client, skeleton, build)
        names = {f"{j.bone}.{j.label}": i for i, j in enumerate(skeleton.joints)}
        infos = [
            pybullet.getJointInfo(self.body_id, link, physicsClientId=client)
            for link in range(pybullet.getNumJoints(self.body_id, physicsClientId=client))
        ]
        # Bullet has its own order of joints: they are found by name
        found = {names[i[1].decode()]: i for i in infos if i[2] == pybullet.JOINT_REVOLUTE}
        self.moving: NDArray[np.int64] = np.array(sorted(found))
        self._links: list[int] = [found[joint][0] for joint in sorted(found)]
        self._low = np.array([skeleton.joints[joint].low_rad for joint in self.moving])
        self._high = np.array([skeleton.joints[joint].high_rad for joint in self.moving])
        count = len(skeleton.joints)
        self.angles, self.speeds = np.zeros(count), np.zeros(count)
        self.strengths_nm, self.damping = np.zeros(count), np.zeros(count)
        self.strengths_nm[self.moving] = [found[joint][10] for joint in self.moving]
        self.damping[self.moving] = [found[joint][6] for joint in self.moving]
        self._base_centre = np.array(self._dynamics(-1)[3])
        self._turn = np.zeros((1, 3, 3))
        self._prepare(infos, {bone.name for bone in skeleton.bones})

    def _prepare(self, infos: list[tuple[Any, ...]], bones: set[str]) -> None:
        """Disable Bullet's motors, limit the joint speeds and choose which links collide."""
        colliders = [(-1, "pelvis")]
        for info in infos:
            bone = bone_of(info[12].decode())
            if bone in bones:
                colliders.append((info[0], bone))
        allow_self_collision(self._client, self.body_id, colliders)
        pybullet.changeDynamics(
            self.body_id,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=_TOP_SPEED,
            physicsClientId=self._client,
        )
        pybullet.setJointMotorControlArray(
            self.body_id,
            self._links,
            pybullet.VELOCITY_CONTROL,
            forces=np.zeros(len(self._links)),
            physicsClientId=self._client,
        )

    # ---- reading

    def read(self) -> bool:
        """Read the joints; return whether all numbers are finite, keep the last ones if not."""
        states = pybullet.getJointStates(self.body_id, self._links, physicsClientId=self._client)
        # zip first: an array of tuples costs three times an array of numbers
        angles, speeds = (np.array(part) for part in list(zip(*states, strict=True))[:2])
        if not (np.isfinite(angles).all() and np.isfinite(speeds).all()):
            return False
        self.angles[self.moving] = angles
        self.speeds[self.moving] = speeds
        return True

    def motion(self) -> Motion:
        """Read pose and velocity of the pelvis."""
        centre, quaternion = pybullet.getBasePositionAndOrientation(
            self.body_id, physicsClientId=self._client
        )
        velocity, spin = pybullet.getBaseVelocity(self.body_id, physicsClientId=self._client)
        quaternions_to_matrices(np.array([quaternion]), self._turn)
        rotation = self._turn[0].copy()
        lever = rotation @ self._base_centre  # Bullet gives the centre of mass
        pose = Pose(np.array(centre) - lever, rotation)
        return Motion(pose, np.array(velocity) - cross(spin, lever), np.array(spin))

    def mass_matrix(self) -> Floats:
        """Return the joint-space inertia ``(6 + n, 6 + n)``: base first, then `moving` joints."""
        angles = list(self.angles[self.moving])
        return np.array(
            pybullet.calculateMassMatrix(self.body_id, angles, physicsClientId=self._client)
        )

    # ---- moving

    def apply(self, torques_nm: Floats) -> None:
        """Apply torques ``(82,)``, N m, in the next physics step only."""
        pybullet.setJointMotorControlArray(
            self.body_id,
            self._links,
            pybullet.TORQUE_CONTROL,
            forces=torques_nm[self.moving].tolist(),
            physicsClientId=self._client,
        )

    def place(self, pose: Pose, angles: Floats) -> None:
        """Set the pose of the pelvis and all joint angles, at rest."""
        self.angles[self.moving], self.speeds[:] = angles[self.moving], 0.0
        centre = pose.position + pose.rotation @ self._base_centre
        turn = matrix_to_quaternion(pose.rotation)
        pybullet.resetBasePositionAndOrientation(
            self.body_id, centre, turn, physicsClientId=self._client
        )
        still = (0.0, 0.0, 0.0)
        pybullet.resetBaseVelocity(self.body_id, still, still, physicsClientId=self._client)
        self._set(np.arange(len(self._links)))

    def hold_limits(self) -> None:
        """Set joints that passed a limit back to it and keep their velocity. Call after `read`.

        Bullet detects a limit only once it is passed. At the limit its own constraint is active and
        removes the velocity with the right reaction on the rest of the body; removing it here would
        add momentum.

        Measured: two thirds of the cost is saved in the next physics step, probably because Bullet
        updates the bounding boxes of all links here instead of there.
        """
        angles = self.angles[self.moving]
        held = np.minimum(np.maximum(angles, self._low), self._high)
        (beyond,) = (held != angles).nonzero()
        if beyond.size:
            self.angles[self.moving] = held
            self._set(beyond)

    def _set(self, which: NDArray[np.int64]) -> None:
        joints = self.moving[which]
        pybullet.resetJointStatesMultiDof(
            self.body_id,
            [self._links[index] for index in which],
            self.angles[joints, None].tolist(),
            self.speeds[joints, None].tolist(),
            physicsClientId=self._client,
        )

    def _dynamics(self, link: int) -> tuple[Any, ...]:
        info: tuple[Any, ...] = pybullet.getDynamicsInfo(
            self.body_id, link, physicsClientId=self._client
        )
        return info


def _load(client: int, skeleton: Skeleton, build: Build) -> int:
    """Load the multibody; Bullet reads URDF from files only."""
    with tempfile.TemporaryDirectory() as folder:
        files = body_files(skeleton, build)
        path = Path(folder) / "child.urdf"
        path.write_text(files.urdf, encoding="utf-8")
        for name, content in files.hulls.items():
            (Path(folder) / name).write_text(content, encoding="utf-8")
        # Bullet would cache the files by their names, which are never used again
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
        body_id: int = pybullet.loadURDF(str(path), flags=_FLAGS, physicsClientId=client)
    return body_id


def damping_number(body: Articulation, step_s: float) -> float:
    """Return ``dt max eig(M^-1 D)``; explicit damping is stable below 2, monotonic up to 1."""
    matrix = body.mass_matrix()
    damping = np.zeros(len(matrix))
    damping[6:] = body.damping[body.moving]
    # M^-1 D is similar to a symmetric matrix: its eigenvalues are real
    root = np.sqrt(damping)
    return step_s * float(np.linalg.eigvalsh(root[:, None] * np.linalg.inv(matrix) * root)[-1])

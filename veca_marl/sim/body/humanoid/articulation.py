"""The articulated bones in Bullet: their state, torques, joint limits and self-collision."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Build, Skeleton, body_files, bone_of
from veca_marl.sim.body.humanoid.body_dynamics import NEW_POSE, BodyDynamics
from veca_marl.sim.body.humanoid.bone_ends import bone_ends
from veca_marl.sim.body.humanoid.link_tree import JointLimits, read_tree
from veca_marl.sim.body.humanoid.separation import separating_shifts
from veca_marl.sim.geometry import Floats, Pose, cross, matrix_to_quaternion
from veca_marl.sim.physics.bullet_client import BulletClient, JointInfo, pybullet

_LEG = ("thigh", "shank", "foot")
_TRUNK = ("pelvis", "spine", "chest", "neck", "head")


def limb(bone: str) -> str:
    """Return which of `trunk`, `l_arm`, `r_arm`, `l_leg`, `r_leg` a bone belongs to."""
    if bone in _TRUNK:
        return "trunk"
    side, part = bone.split("_", 1)
    return f"{side}_leg" if part in _LEG else f"{side}_arm"


def may_collide(a: str, b: str) -> bool:
    """Return whether two bones of one body collide.

    Bones of one limb overlap at their joints by construction, and so do shoulders and hips with
    the trunk; joint limits keep them apart. Without these exceptions dozens of permanent
    contacts make the body jitter and its physics several times as expensive.
    """
    if limb(a) == limb(b):
        return False
    roots = [bone for bone in (a, b) if bone.endswith(("upper_arm", "thigh"))]
    return not (roots and "trunk" in (limb(a), limb(b)))


def allow_self_collision(
    client: BulletClient, body_id: int, links: Sequence[tuple[int, str]]
) -> None:
    """Disable Bullet's contacts for the pairs of links that must not collide.

    Args:
        client: The PyBullet client.
        body_id: A body loaded with `URDF_USE_SELF_COLLISION`.
        links: Index and bone of every link with a collider.
    """
    for (a, bone_a), (b, bone_b) in itertools.combinations(links, 2):
        if not may_collide(bone_a, bone_b):
            client.setCollisionFilterPair(body_id, body_id, a, b, 0)


def exclude_from_collisions(client: BulletClient, body_id: int, links: Iterable[int]) -> None:
    """Exclude links without shapes from collision detection.

    Bullet gives such a link an empty shape with a bounding box of twice the detection distance,
    and keeps a pair of objects for each box that overlaps it.

    Args:
        client: The PyBullet client.
        body_id: A body.
        links: Indices of its links without shapes.
    """
    for link in links:
        client.setCollisionFilterGroupMask(body_id, link, 0, 0)


_TOP_SPEED_RADPS = 30.0  # of a joint: twice the speed of human limbs
# Bullet clips the speed of each joint without its reaction on the body, which adds momentum: its
# limit is so high that it never acts
_BULLET_TOP_SPEED = 1000.0
# m or rad: no motion reaches it; what does becomes infinite within a few steps
_LARGEST = 1e6
# m/s or rad/s: Bullet cuts what is faster to its top speed; joints that are driven with full torque
# reach 120 rad/s
_FASTEST = 0.99 * _BULLET_TOP_SPEED
_STOP_DISTANCE_RAD = 0.05  # 3 degrees, by which Bullet's stops are outside the joint limits
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
        limit_margin_rad: Distance from their limits at which joints are stopped.

    Attributes:
        body_id: Bullet's id.
        bones_of_links: Name of the bone of each link with a collider.
        moving: ``(n,)`` indices of the joints that move, ascending.
        angles: ``(82,)`` rad, at the last `read` or `settle`.
        speeds: ``(82,)`` rad/s.
        strengths_nm: ``(82,)`` N m, the greatest torque of each joint; 0 for fixed joints.
        damping: ``(82,)`` N m s/rad.
        dynamics: Mass matrix and momentum.
        mass_kg: Of the whole body.
    """

    def __init__(
        self, client: BulletClient, skeleton: Skeleton, build: Build, limit_margin_rad: float
    ) -> None:
        self._client = client
        self.body_id = _load(client, skeleton, build)
        names = {f"{j.bone}.{j.label}": i for i, j in enumerate(skeleton.joints)}
        infos = [
            client.getJointInfo(self.body_id, link)
            for link in range(client.getNumJoints(self.body_id))
        ]
        # Bullet has its own order of joints: they are found by name
        found = {names[i.name.decode()]: i for i in infos if i.kind == pybullet.JOINT_REVOLUTE}
        self.moving: NDArray[np.int64] = np.array(sorted(found))
        self._links: list[int] = [found[joint].joint for joint in sorted(found)]
        low = np.array([skeleton.joints[joint].low_rad for joint in self.moving])
        high = np.array([skeleton.joints[joint].high_rad for joint in self.moving])
        self._limits = _limits(len(found))
        count = len(skeleton.joints)
        self.angles, self.speeds = np.zeros(count), np.zeros(count)
        self.strengths_nm, self.damping = np.zeros(count), np.zeros(count)
        self.strengths_nm[self.moving] = [found[joint].max_force for joint in self.moving]
        self.damping[self.moving] = [found[joint].damping for joint in self.moving]
        self._base_centre = np.array(client.getDynamicsInfo(self.body_id, -1).local_centre)
        self._release(low, high)
        limits = JointLimits(low, high, _TOP_SPEED_RADPS, limit_margin_rad)
        tree = read_tree(client, self.body_id)
        ends = bone_ends(client, self.body_id, skeleton, tree, self._base_centre)
        self.dynamics = BodyDynamics(tree, limits, ends, self.damping[self.moving])
        self.mass_kg = float(self.dynamics.tree.masses.sum())
        self._weight = np.zeros(3)  # N
        self.read_gravity()
        self._prepare(infos, {bone.name for bone in skeleton.bones})
        self.read()

    def _prepare(self, infos: list[JointInfo], bones: set[str]) -> None:
        """Disable Bullet's motors, limit the joint speeds and choose which links collide."""
        colliders = [(-1, "pelvis")]
        for info in infos:
            bone = bone_of(info.link_name.decode())
            if bone in bones:
                colliders.append((info.joint, bone))
        self.bones_of_links = dict(colliders)
        shapeless = [info.joint for info in infos if info.joint not in self.bones_of_links]
        exclude_from_collisions(self._client, self.body_id, shapeless)
        allow_self_collision(self._client, self.body_id, colliders)
        self._client.changeDynamics(
            self.body_id,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=_BULLET_TOP_SPEED,
        )
        self._client.setJointMotorControlArray(
            self.body_id, self._links, pybullet.VELOCITY_CONTROL, forces=np.zeros(len(self._links))
        )

    def _release(self, low: Floats, high: Floats) -> None:
        """Disable Bullet's joint damping and move its joint stops outside the limits.

        The torques contain both, see `apply`. Bullet detects a limit only once it is passed: joints
        that rest at one of its stops vibrate.
        """
        for link, lower, upper in zip(self._links, low, high, strict=True):
            self._client.changeDynamics(
                self.body_id,
                link,
                jointLowerLimit=float(lower) - _STOP_DISTANCE_RAD,
                jointUpperLimit=float(upper) + _STOP_DISTANCE_RAD,
                jointDamping=0.0,
            )

    # ---- reading

    def read(self) -> bool:
        """Read the state from Bullet; return whether it is valid, keep the last one if not.

        Call it after everything but a physics step that changes pose or velocity.
        """
        if not self._read():
            return False
        self.dynamics.begin()
        self._copy_joints()
        return True

    def settle(self, step_s: float) -> bool:
        """Read the state after a physics step, apply joint limits and restore the momentum.

        Return whether the state is valid; if not, keep the last one.
        """
        if not self._read():
            return False
        result = self.dynamics.settle(step_s, self._weight, self._touches_others)
        self._copy_joints()
        state, solver = self.dynamics.state, self.dynamics.solver
        # each command updates the bounding boxes that have moved, the first one all of them; joints
        # come after the base because they move few of them
        if result == NEW_POSE:
            self._set_pose(state.position, solver.quaternion)
        changed = solver.changed.nonzero()[0]
        if len(changed):
            self._set_joints(changed)
        self._set_velocity(state.velocity)
        return True

    def keep_apart(self, others: Iterable[Articulation]) -> None:
        """Move this body and others that have settled apart if they are too deep in each other.

        See `separation`.
        """
        for other in others:
            share = other.mass_kg / (self.mass_kg + other.mass_kg)
            shifts = separating_shifts(self._client, self.body_id, other.body_id, share)
            if shifts is not None:
                self.shift(shifts[0])
                other.shift(shifts[1])

    def shift(self, by: Floats) -> None:
        """Move the body by ``(3,)`` metres; its velocity and its joints stay as they are."""
        state = self.dynamics.state
        state.position[:] += by
        self._set_pose(state.position, self.dynamics.solver.quaternion)
        self._set_velocity(state.velocity)

    def read_gravity(self) -> None:
        """Read the client's gravity; call it before each agent step."""
        self._weight = self.mass_kg * np.array(self._client.gravity())

    def _touches_others(self) -> bool:
        found = self._client.getContactPoints(bodyA=self.body_id)
        return any(contact.body_a != contact.body_b for contact in found)

    def _read(self) -> bool:
        """Read Bullet's state; return whether it is valid, keep the last one if not.

        It is valid if all numbers are finite, below `_LARGEST`, speeds below `_FASTEST`.
        """
        states = self._client.getJointStates(self.body_id, self._links)
        position, quaternion = self._client.getBasePositionAndOrientation(self.body_id)
        velocity, spin = self._client.getBaseVelocity(self.body_id)
        # zip first: an array of tuples costs three times an array of numbers
        angles, speeds, _, _ = zip(*states, strict=True)
        row = np.array(position + quaternion + spin + velocity + speeds + angles)
        if not (np.abs(row) < self._limits).all():  # false for numbers that are not finite
            return False
        self.dynamics.solver.numbers[:] = row
        return True

    def _copy_joints(self) -> None:
        state = self.dynamics.state
        self.angles[self.moving], self.speeds[self.moving] = state.angles, state.velocity[6:]

    def motion(self) -> Motion:
        """Return pose and velocity of the pelvis at the last `read` or `settle`."""
        state = self.dynamics.state
        rotation, spin = state.rotation.copy(), state.velocity[:3].copy()
        lever = rotation @ self._base_centre  # Bullet's position is that of the centre of mass
        return Motion(
            Pose(state.position - lever, rotation), state.velocity[3:6] - cross(spin, lever), spin
        )

    # ---- moving

    def apply(self, torques_nm: Floats, stiffness: Floats, step_s: float) -> None:
        """Apply motor torques and joint damping in the next physics step only.

        Args:
            torques_nm: ``(82,)`` N m, at the present angles.
            stiffness: ``(82,)`` N m/rad, by which the torques decrease with the angle.
            step_s: Duration of the physics step.
        """
        forces = self.dynamics.forces
        forces.drive[:], forces.stiffness[:] = torques_nm[self.moving], stiffness[self.moving]
        self._client.setJointMotorControlArray(
            self.body_id,
            self._links,
            pybullet.TORQUE_CONTROL,
            forces=self.dynamics.torques(step_s).tolist(),
        )

    def place(self, pose: Pose, angles: Floats) -> None:
        """Set the pose of the pelvis and all joint angles, at rest."""
        self.angles[self.moving], self.speeds[:] = angles[self.moving], 0.0
        centre = pose.position + pose.rotation @ self._base_centre
        self._set_pose(centre, matrix_to_quaternion(pose.rotation))
        self._set_velocity(np.zeros(6))
        self._set_joints(np.arange(len(self.moving)))

    def set_speeds(self, speeds: Floats) -> None:
        """Set all joint speeds ``(82,)``, rad/s, with the base as it is."""
        self.speeds[self.moving] = speeds[self.moving]
        self._set_joints(np.arange(len(self.moving)))

    def _set_pose(self, position: Floats, quaternion: Floats) -> None:
        """Set position and orientation of the base; Bullet sets its velocity to 0."""
        self._client.resetBasePositionAndOrientation(
            self.body_id, position.tolist(), quaternion.tolist()
        )

    def _set_velocity(self, velocity: Floats) -> None:
        """Set angular and linear velocity ``(6,)`` of the base; more numbers are ignored."""
        numbers = velocity[:6].tolist()
        self._client.resetBaseVelocity(self.body_id, numbers[3:], numbers[:3])

    def _set_joints(self, chosen: NDArray[np.int64]) -> None:
        """Set chosen rows of `moving` to `angles` and `speeds`."""
        joints = self.moving[chosen, None]
        self._client.resetJointStatesMultiDof(
            self.body_id,
            [self._links[row] for row in chosen],
            self.angles[joints].tolist(),
            self.speeds[joints].tolist(),
        )


def _load(client: BulletClient, skeleton: Skeleton, build: Build) -> int:
    """Load the multibody; Bullet reads URDF from files only."""
    with tempfile.TemporaryDirectory() as folder:
        files = body_files(skeleton, build)
        path = Path(folder) / "child.urdf"
        path.write_text(files.urdf, encoding="utf-8")
        for name, content in files.hulls.items():
            (Path(folder) / name).write_text(content, encoding="utf-8")
        # Bullet would cache the files by their names, which are never used again
        client.setPhysicsEngineParameter(enableFileCaching=0)
        body_id: int = client.loadURDF(str(path), flags=_FLAGS)
    return body_id


def _limits(joints: int) -> Floats:
    """Return what the numbers of `SolverState` are below in any motion, ``(13 + 2 n,)``."""
    speeds = np.full(6 + joints, _FASTEST)
    return np.concatenate([np.full(3 + 4, _LARGEST), speeds, np.full(joints, _LARGEST)])

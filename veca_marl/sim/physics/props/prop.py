"""The props of a world: where they are, and how to put them elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import (
    Floats,
    Scene,
    matrix_to_quaternion,
    quaternion_from_yaw,
    quaternions_to_matrices,
    rotation_about_vertical,
)
from veca_marl.sim.kernels import kernel
from veca_marl.sim.physics.bullet import are_in_contact
from veca_marl.sim.physics.bullet_client import BulletClient, Quaternion, Vector
from veca_marl.sim.physics.props.geoms import (
    bounding_box,
    horizontal_radius_m,
    lowest_m,
    make_obstacles,
    prop_geoms,
    prop_radius_m,
    sound_obstacles,
)
from veca_marl.sim.physics.props.joint import Joint
from veca_marl.sim.physics.props.prop_cfg import PropCfg
from veca_marl.sim.physics.props.rigid_body import create_body, is_turned, pose_reader
from veca_marl.sim.sound import Source
from veca_marl.sim.sound.obstacles import Obstacles


class Rest(Protocol):
    """What a prop calls before it is moved, so that sleeping props notice."""

    def wake(self) -> None:
        """Wake the prop, before its velocity is set or its motor is started."""

    def wake_around(self) -> None:
        """Wake the prop and what it may have supported, before it is put elsewhere."""


class Awake:
    """The rest of a prop in a world in which nothing sleeps."""

    def wake(self) -> None:
        """Do nothing."""

    def wake_around(self) -> None:
        """Do nothing."""


_LARGEST_M = 1e6  # no playground is as large; the limit of bodies, too


class Prop:
    """A prop in a world. Made by `World.add_prop`.

    Attributes:
        cfg: What it was made from.
        body_id: PyBullet's id.
        link: PyBullet's index of the link that moves with its frame; -1 is the base.
        links: The links that carry its shapes, `link` first.
        geoms: Its primitives, in its own frame.
        reach_m: Horizontal radius of the cylinder about the origin of its frame that contains them
            while it is not tilted.
        extent_m: Greatest distance of a corner of the box about them from that origin.
        half_size_m: Half of the shortest edge of that box.
        was_launched: Whether its velocity has been set; `FastProps` sets it back.
        centre_of_mass: ``(3,)`` metres, in its frame; the origin of a fixed prop.
        object_id: Its value in segmentation images.
        joint: Its hinge or slide; None for a prop that is fixed or free.
        sound: Its sound source; None for a silent prop.
        impact: The source of its sound when it is hit; None without sounds of impacts.
        holder: Name of the body that holds it; None while it is free.
        rest: What wakes sleeping props before this one is moved.
        row: Its first row in the poses of the scene.
        accepts: Whether a body may put a given prop into it (the verb `put_into`); a task may set
            another function when it builds its props.
    """

    def __init__(
        self,
        cfg: PropCfg,
        client: BulletClient,
        scene: Scene,
        sound: Source | None,
        obstacles: Obstacles,
    ) -> None:
        self.cfg = cfg
        self.sound = sound
        self.impact: Source | None = None
        self.holder: str | None = None
        self.rest: Rest = Awake()
        self.accepts: Callable[[Prop], bool] = _anything
        self._client = client
        self._scene = scene
        self.geoms = geoms = prop_geoms(cfg)
        shown = scene.add_object(cfg.name, [geoms])
        self.object_id = shown.id
        self.row = shown.rows.start
        self.reach_m = horizontal_radius_m(geoms)
        self._inside = bounding_box(geoms)
        self.extent_m = float(np.linalg.norm(np.abs(self._inside).max(axis=0)))
        self.half_size_m = float((self._inside[1] - self._inside[0]).min()) / 2.0
        self.was_launched = False
        self.body_id, self.link, self.joint, frame = create_body(cfg, client, geoms)
        self.links = range(self.link, client.getNumJoints(self.body_id))
        self._last_pose: tuple[Vector, Quaternion] | None = None
        self._read_pose = pose_reader(self.body_id, self.link, client)
        self.centre_of_mass = frame.position
        self._centre = frame.position if frame.position.any() else None
        self._axes = frame.rotation if is_turned(frame) else None
        boxes = sound_obstacles(cfg, geoms)
        self._obstacles = make_obstacles(boxes, cfg, self.body_id, client, obstacles)
        self.place(cfg.position_m, math.radians(cfg.yaw_deg))

    @property
    def name(self) -> str:
        """The name given in its configuration."""
        return self.cfg.name

    @property
    def fixed(self) -> bool:
        """Whether it is part of the building."""
        return self.cfg.mass_kg == 0.0

    @property
    def may_have_moved(self) -> bool:
        """Whether its pose may have changed since `follow_physics` copied it."""
        return not self.fixed if self.joint is None else self.joint.moved

    @property
    def radius_m(self) -> float:
        """Horizontal radius of the cylinder about the origin of its frame, untilted, in metres."""
        return prop_radius_m(self.cfg, self.reach_m)

    @property
    def lowest_m(self) -> float:
        """Height of its lowest point."""
        return float(self.position[2]) + lowest_m(self.geoms, self.rotation)

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the corners ``(3,)`` of Bullet's box about it, along the axes of the world."""
        boxes = [self._client.getAABB(self.body_id, link) for link in self.links]
        low, high = np.array(boxes).swapaxes(0, 1)
        return low.min(axis=0), high.max(axis=0)

    @property
    def position(self) -> Floats:
        """``(3,)`` metres, world frame."""
        return np.array(self._scene.positions[self.row])

    @property
    def mass_centre(self) -> Floats:
        """``(3,)`` metres: its centre of mass in the world frame."""
        return self.position + self.rotation @ self.centre_of_mass

    @property
    def rotation(self) -> Floats:
        """``(3, 3)`` rotation to the world frame."""
        return np.array(self._scene.rotations[self.row])

    @property
    def yaw_rad(self) -> float:
        """Angle in [-pi, pi] of its x axis about the vertical."""
        x, y, _ = self._scene.rotations[self.row][:, 0]
        return math.atan2(y, x)

    @property
    def colour(self) -> Floats:
        """``(3,)`` RGB in [0, 1]: the present colour of its first shape."""
        return np.array(self._scene.objects[self.object_id].colour)

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s, world frame, of its centre of mass."""
        return np.array(self._velocities()[0])

    @property
    def angular_velocity(self) -> Floats:
        """``(3,)`` rad/s, world frame."""
        return np.array(self._velocities()[1])

    def _velocities(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the velocity and the angular velocity, world frame."""
        if self.joint is None:
            linear, angular = self._client.getBaseVelocity(self.body_id)
        else:
            state = self._client.getLinkState(self.body_id, self.link, computeLinkVelocity=1)
            linear, angular = state.velocity, state.angular_velocity
        return linear, angular

    @property
    def box(self) -> tuple[Floats, Floats]:
        """The corners ``(3,)`` of the box about its shapes, in its own frame, metres."""
        return self._inside

    @property
    def opening(self) -> float:
        """How far its joint is open, from 0 (closed) to 1."""
        return self._joint().opening

    @property
    def locked(self) -> bool:
        """Whether it has a joint that is locked."""
        return self.joint is not None and self.joint.locked

    def set_opening(self, opening: float) -> None:
        """Put a door or drawer at rest at an opening in [0, 1]; see also `open`."""
        self.rest.wake_around()
        self._joint().set_opening(opening)
        follow_physics([self])

    def open(self) -> bool:
        """Let the motor of its joint open it; return False if it is locked or has no joint."""
        return self._drive(1.0)

    def close(self) -> bool:
        """Let the motor of its joint close it; return False if it is locked or has no joint."""
        return self._drive(0.0)

    def takes(self, key: Prop) -> bool:
        """Return whether another prop is the key of the lock of its joint."""
        return self.joint is not None and self.joint.takes(key.name)

    def unlock(self, key: Prop) -> bool:
        """Unlock its joint with a key; return whether that prop is the key of its lock."""
        return self.joint is not None and self.joint.unlock(key.name)

    def contains(self, other: Prop) -> bool:
        """Return whether the centre of mass of another prop is in the box about its own shape.

        This is what a basket or drawer contains: their shapes are walls and a floor.
        """
        low, high = self._inside
        local = self.rotation.T @ (other.mass_centre - self.position)
        return bool((local >= low).all() and (local <= high).all())

    def yields(self, point: Sequence[float], force: Sequence[float]) -> bool:
        """Return whether a force ``(3,)`` at a point ``(3,)`` of the world could move it.

        False for fixed props, and for doors and drawers that are locked or at their stop.
        """
        if self.joint is not None:
            return self.joint.yields(point, force)
        return not self.fixed

    def touches(self, body_id: int) -> bool:
        """Return whether it was in contact with a body of PyBullet in the last physics step."""
        return are_in_contact(self._client, self.body_id, body_id)

    def place(
        self,
        position: Sequence[float] | Floats,
        yaw_rad: float = 0.0,
        velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    ) -> None:
        """Set pose and velocity. Its sound starts at the new place, without a Doppler sweep.

        For a prop with a joint this is the pose of the closed prop: the opening stays as it is,
        and velocities have no effect.

        Args:
            position: ``(3,)`` metres.
            yaw_rad: Rotation about z; any other rotation is undone.
            velocity: ``(3,)`` m/s, of the centre of mass.
            angular_velocity: ``(3,)`` rad/s.

        Raises:
            ValueError: If a number is not finite.
        """
        self.carry(position, yaw_rad, velocity, angular_velocity)
        self.teleport_sounds()

    def teleport_sounds(self) -> None:
        """Let its sounds start at its present place, without a Doppler sweep from the last one."""
        for source in (self.sound, self.impact):
            if source is not None:
                source.teleport(self.position)

    def carry(
        self,
        position: Sequence[float] | Floats,
        yaw_rad: float,
        velocity: Sequence[float] | Floats,
        angular_velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    ) -> None:
        """Set pose and velocity as `place` does, as a step of a motion: its sound moves along.

        Args:
            position: ``(3,)`` metres.
            yaw_rad: Rotation about z; any other rotation is undone.
            velocity: ``(3,)`` m/s, of the centre of mass.
            angular_velocity: ``(3,)`` rad/s.

        Raises:
            ValueError: If a number is not finite.
        """
        x, y, z = _three_finite(self.name, "position", position)
        self.rest.wake_around()
        quaternion: Sequence[float] = quaternion_from_yaw(yaw_rad)
        origin = self._centre if self.joint is None else np.asarray(self.joint.cfg.anchor_m)
        if origin is not None:
            (x, y, z) = np.array([x, y, z]) + rotation_about_vertical(yaw_rad) @ origin
        if self._axes is not None and self.joint is None:
            quaternion = matrix_to_quaternion(
                rotation_about_vertical(yaw_rad) @ self._axes
            ).tolist()
        self._client.resetBasePositionAndOrientation(self.body_id, (x, y, z), quaternion)
        if self.joint is not None:
            self.joint.follow_base()
        self.set_velocity(velocity, angular_velocity)
        follow_physics([self])

    def set_velocity(
        self,
        velocity: Sequence[float] | Floats,
        angular_velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    ) -> None:
        """Set the velocity (m/s) and the angular velocity (rad/s).

        Fixed props stay at rest, and so do props with a joint.
        """
        if not self.fixed and self.joint is None:
            self.rest.wake()
            self.was_launched = True
            self._client.resetBaseVelocity(
                self.body_id,
                _three_finite(self.name, "velocity", velocity),
                _three_finite(self.name, "angular velocity", angular_velocity),
            )

    def _drive(self, opening: float) -> bool:
        """Start the motor of its joint; return False if it is locked or has no joint."""
        self.rest.wake()
        return self.joint is not None and self.joint.drive(opening)

    def _joint(self) -> Joint:
        if self.joint is None:
            raise ValueError(f"prop {self.name!r} has no joint")
        return self.joint


def follow_physics(props: Sequence[Prop]) -> list[str]:
    """Copy the poses of props of one world from Bullet to the scene, sound sources and obstacles.

    Only those are copied whose pose is not the one that was copied last. All at once takes 0.4 of
    the time of one after the other.

    Returns:
        Names of the props whose pose is not finite or beyond 1e6 m; if there is one, nothing is
        copied.
    """
    moved: list[Prop] = []
    poses: list[tuple[Vector, Quaternion]] = []
    for prop in props:
        pose = prop._read_pose()
        if pose != prop._last_pose:  # true for numbers that are not finite
            moved.append(prop)
            poses.append(pose)
        elif prop.joint is not None:
            prop.joint.moved = False
    return _copy_poses(moved, poses) if moved else []


def copy_all_poses(props: Sequence[Prop]) -> list[str]:
    """Copy the poses of props as `follow_physics` does, also those that are the same as before.

    After a reset no sign of a zero depends on the last episode.
    """
    for prop in props:
        prop._last_pose = None
    return follow_physics(props)


def _copy_poses(props: Sequence[Prop], poses: Sequence[tuple[Vector, Quaternion]]) -> list[str]:
    """Copy poses of Bullet, one or more, to where `follow_physics` says; return what it returns."""
    positions, rotations = props[0]._scene.positions, props[0]._scene.rotations
    numbers = np.array([(*centre, *orientation) for centre, orientation in poses])
    rows = np.array([prop.row for prop in props])
    valid = np.empty(len(rows), np.bool_)
    if not _write_poses(numbers, rows, positions, rotations, valid):
        return [prop.name for prop, good in zip(props, valid, strict=True) if not good]
    for prop, pose in zip(props, poses, strict=True):
        row = prop.row
        prop._last_pose = pose
        if prop._axes is not None:
            rotations[row] = rotations[row] @ prop._axes.T
        if prop._centre is not None:
            positions[row] -= rotations[row] @ prop._centre
        if prop.sound is not None:
            prop.sound.position = positions[row]
        if prop.impact is not None:
            prop.impact.position = positions[row]
        for obstacle in prop._obstacles:
            obstacle.move(positions[row], rotations[row])
        if prop.joint is not None:
            prop.joint.moved = False
    return []


@kernel
def _write_poses(
    poses: Floats,
    rows: NDArray[np.int64],
    positions: Floats,
    rotations: Floats,
    valid: NDArray[np.bool_],
) -> bool:
    """Write poses into a scene if all are valid; return whether they are.

    Args:
        poses: ``(n, 7)`` positions in metres and quaternions (x, y, z, w); not finite or far away
            where a simulation has failed.
        rows: ``(n,)`` their frames.
        positions: ``(F, 3)`` metres, of all frames; written.
        rotations: ``(F, 3, 3)``, likewise.
        valid: ``(n,)`` which of the poses are; written.
    """
    all_valid = True
    for n in range(len(rows)):
        valid[n] = True
        for k in range(3):
            if not abs(poses[n, k]) < _LARGEST_M:  # true for numbers that are not finite
                valid[n] = False
        for k in range(3, 7):
            if not np.isfinite(poses[n, k]):
                valid[n] = False
        all_valid = all_valid and valid[n]
    if all_valid:
        for n in range(len(rows)):
            row = rows[n]
            for k in range(3):
                positions[row, k] = poses[n, k]
            quaternions_to_matrices(poses[n : n + 1, 3:], rotations[row : row + 1])
    return all_valid


def _anything(prop: Prop) -> bool:
    """Accept all props."""
    return True


def _three_finite(name: str, what: str, vector: Sequence[float] | Floats) -> list[float]:
    numbers = [float(value) for value in vector]
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"prop {name!r}: {what} {numbers} must be three finite numbers")
    return numbers

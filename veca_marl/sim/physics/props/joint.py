"""Joints of props, as data and in Bullet: doors, drawers, lids that are pushed, driven, locked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet


class JointKind(Enum):
    """How an attached prop can move."""

    hinge = "hinge"
    slide = "slide"


@dataclass
class LockCfg:
    """The lock of a joint.

    Attributes:
        key: Name of the prop that unlocks it, one that is not fixed; empty for a lock that no prop
            opens.
        locked: Whether it is locked at the start of an episode. A locked joint does not move.
    """

    key: str = ""
    locked: bool = True


@dataclass
class JointCfg:
    """The joint by which a prop is attached to the world or to a fixed prop.

    `PropCfg.position_m` and `yaw_deg` are the pose of the closed prop, opening 0.

    Attributes:
        kind: A hinge turns about `axis`, a slide moves along it.
        parent: Name of a fixed prop added before, such as the cupboard of a drawer: the two do not
            collide. Empty: the world.
        axis: Direction of the axis in the frame of the closed prop, of any length; openings are
            right-handed rotations about it or translations along it.
        anchor_m: A point on the axis of a hinge, in the frame of the prop.
        range_deg: Rotation of a hinge at opening 1.
        range_m: Travel of a slide at opening 1.
        friction: Coulomb friction of the joint: N m for a hinge, N for a slide.
        motor: Greatest torque (N m) or force (N) of the motor that opens and closes the prop
            (`Prop.open`, `Prop.close`), in addition to the friction.
        open_s: Duration of a driven motion from opening 0 to 1.
        opening: Opening at the start of an episode, in [0, 1].
        lock: A lock; None if it has none.
    """

    kind: JointKind = JointKind.hinge
    parent: str = ""
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    anchor_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    range_deg: float = 90.0
    range_m: float = 0.3
    friction: float = 0.3
    motor: float = 10.0
    open_s: float = 1.0
    opening: float = 0.0
    lock: LockCfg | None = field(default=None)

    @property
    def range(self) -> float:
        """Greatest coordinate of the joint: rad for a hinge, metres for a slide."""
        return math.radians(self.range_deg) if self.kind is JointKind.hinge else self.range_m

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not isinstance(self.kind, JointKind):
            kinds = [kind.name for kind in JointKind]
            raise ValueError(f"joint: kind={self.kind!r}; there are {kinds}")
        if not all(math.isfinite(value) for value in (*self.axis, *self.anchor_m)):
            raise ValueError(
                f"joint: axis={tuple(self.axis)}, anchor_m={tuple(self.anchor_m)} must be finite"
            )
        if not any(self.axis):
            raise ValueError("joint: axis=(0, 0, 0) has no direction")
        for name in ("range_deg", "range_m", "open_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"joint: {name}={value} must be positive")
        if self.range_deg > 180.0:
            raise ValueError(f"joint: range_deg={self.range_deg} must be at most 180")
        for name in ("friction", "motor"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"joint: {name}={value} is not 0 or more")
        if not 0.0 <= self.opening <= 1.0:
            raise ValueError(f"joint: opening={self.opening} is not in [0, 1]")


LINK = 1
"""The link that a joint moves, with the first shape of the prop; see `create_attached_body`."""

_ARRIVED = 1e-6  # rad or metres: Bullet's stop at the end of the range leaves a rounding error


class Joint:
    """The hinge or slide of one prop.

    Its coordinate, in rad or metres, is 0 when closed and `JointCfg.range` at opening 1. Bullet
    solves friction and stops; what the solver leaves beyond a stop is removed after each physics
    step, so that the range is never exceeded.

    Args:
        cfg: The joint.
        body_id: PyBullet's id of the attached prop.
        client: The PyBullet client.

    Attributes:
        cfg: As above.
        locked: Whether it is locked: it does not move at all.
        stop_speed: Speed (rad/s or m/s) with which it met an end of its range in the last physics
            step; 0 if it met none.
        moved: Whether it may have moved since `follow_physics` copied the pose of the prop.
    """

    def __init__(self, cfg: JointCfg, body_id: int, client: BulletClient) -> None:
        self.cfg = cfg
        self._body_id = body_id
        self._client = client
        axis = np.asarray(cfg.axis, np.float64)
        self._axis: Floats = axis / np.linalg.norm(axis)
        self.locked = False
        self.stop_speed = 0.0
        self.moved = True
        self._anchor: Floats | None = None
        self._before = (0.0, 0.0)
        self._held = 0.0
        self._built = (False, 0.0)
        self._target: float | None = None
        self._direction = 1.0
        client.changeDynamics(
            body_id, LINK, jointLowerLimit=0.0, jointUpperLimit=cfg.range, jointDamping=0.0
        )
        self.locked = cfg.lock is not None and cfg.lock.locked
        self.set_opening(cfg.opening)
        self.save()

    @property
    def opening(self) -> float:
        """From 0 (closed) to 1."""
        return min(max(self._state()[0] / self.cfg.range, 0.0), 1.0)

    @property
    def speed(self) -> float:
        """Speed of the coordinate: rad/s or m/s, positive while it opens."""
        return self._state()[1]

    @property
    def driven(self) -> bool:
        """Whether its motor moves it."""
        return self._target is not None

    @property
    def anchor(self) -> Floats:
        """``(3,)`` metres, world frame: a point of the axis, at the base of the body in Bullet."""
        if self._anchor is None:
            anchor, _ = self._client.getBasePositionAndOrientation(self._body_id)
            self._anchor = np.array(anchor)
        return self._anchor

    def follow_base(self) -> None:
        """Note that the base of the body was put elsewhere."""
        self._anchor = None
        self.moved = True

    def save(self) -> None:
        """Make the present lock and opening the built state, to which `reset` returns."""
        self._built = (self.locked, self._held)

    def reset(self) -> None:
        """Stop the motor and return to the saved lock; Bullet restores coordinate and base."""
        self.follow_base()
        self._release_motor()
        self.locked, self._held = self._built
        self.stop_speed = 0.0
        self._before = self._state()

    def forget(self) -> None:
        """See `BulletSetting`: a motor needs none."""

    def apply(self) -> None:
        """See `BulletSetting`: let the motor go on, or act as friction."""
        if self._target is None:
            self._release_motor()
        else:
            self._start_motor()

    def set_opening(self, opening: float) -> None:
        """Put it at rest at an opening in [0, 1], also if it is locked."""
        self._held = self._checked(opening) * self.cfg.range
        self._release_motor()
        self._set_coordinate(self._held)

    def drive(self, opening: float) -> bool:
        """Let the motor move it to an opening in [0, 1]; return False if it is locked.

        The motor is limited to `JointCfg.motor`: whatever blocks the way holds it up.
        """
        target = self._checked(opening) * self.cfg.range
        if self.locked:
            return False
        self._target = target
        self._direction = 1.0 if target > self._state()[0] else -1.0
        self._start_motor()
        return True

    def lock(self) -> None:
        """Lock it where it is."""
        self._held = min(max(self._state()[0], 0.0), self.cfg.range)
        self._release_motor()
        self.locked = True

    def takes(self, key: str) -> bool:
        """Return whether the prop of a name is the key of its lock."""
        return self.cfg.lock is not None and bool(key) and key == self.cfg.lock.key

    def unlock(self, key: str) -> bool:
        """Unlock it with the prop of a name; return whether that prop is its key."""
        if not self.takes(key):
            return False
        self.locked = False
        return True

    def yields(self, point: Sequence[float], force: Sequence[float]) -> bool:
        """Return whether a force would move it: it is neither locked nor at its stop.

        Args:
            point: ``(3,)`` metres, where the force acts, world frame.
            force: ``(3,)`` its direction, of any length.
        """
        if self.locked:
            return False
        base, quaternion = self._client.getBasePositionAndOrientation(self._body_id)
        turn = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        axis, push = turn @ self._axis, np.asarray(force, np.float64)
        if self.cfg.kind is JointKind.hinge:
            push = np.cross(np.subtract(point, base), push)
        generalised, coordinate = float(axis @ push), self._state()[0]
        if generalised > 0.0:
            return coordinate < self.cfg.range
        return generalised < 0.0 and coordinate > 0.0

    def after_substep(self) -> None:
        """Hold what is locked, stop at the ends of the range and at the motor's target."""
        coordinate, speed = self._state()
        self.stop_speed = 0.0
        if self.locked:
            if coordinate != self._held or speed != 0.0:
                self._set_coordinate(self._held)
            return
        (last, approach), self._before = self._before, (coordinate, speed)
        self.moved = self.moved or coordinate != last
        target = self._target
        if coordinate == last and speed == 0.0 and target is None:
            return  # at rest within its range, as doors mostly are
        if self._at_end(coordinate) and not self._at_end(last):
            self.stop_speed = abs(approach)
        if target is not None and (coordinate - target) * self._direction > -_ARRIVED:
            self._set_coordinate(target)
            self._release_motor()
        elif not 0.0 <= coordinate <= self.cfg.range:
            self._set_coordinate(min(max(coordinate, 0.0), self.cfg.range))

    def _state(self) -> tuple[float, float]:
        """Return coordinate and speed."""
        state = self._client.getJointState(self._body_id, LINK)
        return state.position, state.velocity

    def _at_end(self, coordinate: float) -> bool:
        """Return whether a coordinate is at or beyond an end of the range."""
        return not _ARRIVED < coordinate < self.cfg.range - _ARRIVED

    def _set_coordinate(self, coordinate: float) -> None:
        self.moved = True
        self._before = (coordinate, 0.0)
        self._client.resetJointState(self._body_id, LINK, coordinate, 0.0)

    def _start_motor(self) -> None:
        """Move towards the target; Bullet has one motor for each joint, and friction is off."""
        self._set_motor(self._direction * self.cfg.range / self.cfg.open_s, self.cfg.motor)

    def _release_motor(self) -> None:
        """Leave only friction: a motor that holds the speed 0 with a limited force."""
        self._target = None
        self._set_motor(0.0, self.cfg.friction)

    def _set_motor(self, speed: float, force: float) -> None:
        self._client.setJointMotorControl2(
            self._body_id, LINK, pybullet.VELOCITY_CONTROL, targetVelocity=speed, force=force
        )

    def _checked(self, opening: float) -> float:
        if not 0.0 <= opening <= 1.0:
            raise ValueError(f"opening={opening} is not in [0, 1]")
        return opening

"""Joints of props as data: doors, drawers and lids, and their locks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum


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

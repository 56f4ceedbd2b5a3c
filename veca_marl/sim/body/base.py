"""What senses, tasks and environments may ask of any body, whatever moves it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

from numpy.typing import NDArray

from veca_marl.sim.body.voice import VoiceKind
from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.spec import ArraySpec

MOUNTS = ("head", "eye_left", "eye_right", "ear_left", "ear_right", "mouth")


@dataclass
class BodyCfg:
    """What every body can be told.

    Attributes:
        eye_range_deg: How far the eyes turn in the head.
        voice: Whether the action has a part `voice` that chooses a call.
    """

    eye_range_deg: float = 50.0
    voice: VoiceKind = VoiceKind.silent

    def __post_init__(self) -> None:
        """All numbers of a body are magnitudes."""
        self._check_choices(voice=VoiceKind)
        for name, value in vars(self).items():
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"body.{name}={value} must be a finite number, 0 or more")

    def _check_choices(self, **kinds: type[Enum]) -> None:
        """Raise `ValueError` for a field that is no member of its enumeration."""
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                choices = [choice.name for choice in kind]
                raise ValueError(f"body.{name}={getattr(self, name)!r}; there are {choices}")


class Body(Protocol):
    """A humanoid in a world.

    Attributes:
        name: Unique in its world.
        object_id: The id under which its bones are drawn in the world's `Scene` and appear in
            segmentation images.
        action_spec: The parts of the action that `act` takes, by name: a float32 vector in
            [-1, 1], or one of several choices (shape ``()``, int64).
        focal_distance_m: What the eyes' lenses are adjusted to; ``inf`` when relaxed.
        muted: Whether nobody hears its voice, itself included. Stays until set anew.
        own_head_frames: Indices of the body's frames (bones) that its own eyes must not see.
        joint_names: The 82 joints, such as `l_forearm.flexion`, in the order of all joint arrays.
        bone_names: The 47 bones, such as `l_forearm`, in the order of all bone arrays.
    """

    name: str
    object_id: int
    action_spec: dict[str, ArraySpec]
    focal_distance_m: float
    muted: bool
    own_head_frames: tuple[int, ...]
    joint_names: tuple[str, ...]
    bone_names: tuple[str, ...]

    @property
    def position(self) -> Floats:
        """``(3,)`` metres: the pelvis in the world frame."""
        ...

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: velocity of the pelvis in the world frame."""
        ...

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector the trunk faces."""
        ...

    def mount(self, name: str) -> Pose:
        """Return where a sense organ is: one of `MOUNTS`. Eyes look along their x axis."""
        ...

    def act(self, action: Mapping[str, Any]) -> None:
        """Apply an action that `action_spec` describes; movement lasts until the next call."""
        ...

    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action that comes nearest to an expert's command."""
        ...

    def rest(self) -> None:
        """Do nothing until the next call: stand, or keep the joints where they are."""
        ...

    def place(self, position: Floats | tuple[float, float, float], yaw_rad: float = 0.0) -> None:
        """Start anew at a place of the floor, facing `yaw_rad`, at rest."""
        ...

    @property
    def is_finite(self) -> bool:
        """Whether the simulation of this body makes sense; if not, build the world anew."""
        ...

    # ---- the paper's physical API

    def bone(self, name: str) -> Pose:
        """Return the pose of a bone."""
        ...

    def bone_positions(self) -> Floats:
        """Return the origins of all bones, ``(47, 3)`` metres in the world frame."""
        ...

    def bone_rotations(self) -> Floats:
        """Return the frames of all bones, ``(47, 3, 3)`` to the world frame."""
        ...

    def velocities(self) -> Floats:
        """Return the velocities of the bones' origins, ``(47, 3)`` m/s in the world frame."""
        ...

    def angular_velocities(self) -> Floats:
        """Return the angular velocities of the bones, ``(47, 3)`` rad/s in the world frame."""
        ...

    def joint_angles(self) -> Floats:
        """Return all joint angles, ``(82,)`` rad."""
        ...

    def joint_velocities(self) -> Floats:
        """Return how fast all joints turn, ``(82,)`` rad/s."""
        ...

    def joint_torques(self) -> Floats:
        """Return what the joints' motors give, ``(82,)`` as shares of their strength."""
        ...

    def head_motion(self) -> tuple[Floats, Floats]:
        """Return velocity ``(3,)`` m/s and angular velocity ``(3,)`` rad/s of the middle head."""
        ...

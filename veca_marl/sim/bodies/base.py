"""What senses, tasks and environments may ask of any body, whatever moves it."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray

from veca_marl.sim.pose import Floats, Pose
from veca_marl.sim.spec import ArraySpec

MOUNTS = ("head", "eye_left", "eye_right", "ear_left", "ear_right", "mouth")


class Body(Protocol):
    """A humanoid in a world.

    Attributes:
        name: Unique in its world.
        object_id: The id under which its bones are drawn in the world's `Scene` and appear in
            segmentation images.
        action_spec: The action row that `act` takes.
        focal_distance_m: What the eyes' lenses are adjusted to; ``inf`` when relaxed.
        own_head_frames: Indices of the body's frames (bones) that its own eyes must not see.
    """

    name: str
    object_id: int
    action_spec: ArraySpec
    focal_distance_m: float
    own_head_frames: tuple[int, ...]

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

    def act(self, action: NDArray[Any]) -> None:
        """Take the row that `action_spec` describes; it holds until the next call."""
        ...

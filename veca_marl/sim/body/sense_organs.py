"""Where the sense organs are, and what a body knows of its own eyes.

Positions of the organs are those of the body of 0.78 m, a child of about 15 months, in the frame of
the head bone (origin at the top of the neck). The interpupillary distance of 45 mm and the head
breadth of 128 mm are of the order that anthropometry reports for that age (quoted from memory, not
checked against a table); the rest follows from the head of our skeleton. On a body of another size
they are `Growth.head_size` times as far from the top of the neck.

Bodies are below vision in the order of imports. `veca_marl.sim.senses.make_senses` gives each body
its sight, see `Body.sight`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np

from veca_marl.sim.body.anatomy import Bone
from veca_marl.sim.geometry import Floats, Pose, Shape
from veca_marl.sim.physics import Prop

MOUNTS_M: dict[str, tuple[float, float, float]] = {
    "head": (0.010, 0.0, 0.066),
    "eye_left": (0.078, 0.0225, 0.075),
    "eye_right": (0.078, -0.0225, 0.075),
    "ear_left": (0.010, 0.064, 0.066),
    "ear_right": (0.010, -0.064, 0.066),
    "mouth": (0.088, 0.0, 0.030),
}
MOUNTS = tuple(MOUNTS_M)
EYES = ("eye_left", "eye_right")


def resting_mount(name: str, head: Pose, head_size: float = 1.0) -> Pose:
    """Return the pose of an organ whose axes are the head's.

    Args:
        name: One of `MOUNTS`.
        head: Pose of the head bone.
        head_size: `Growth.head_size` of the body.

    Raises:
        KeyError: If there is no such organ; the message lists those that exist.
    """
    try:
        offset = _offsets(head_size)[name]
    except KeyError:
        raise KeyError(f"no mount {name!r}; there are {list(MOUNTS_M)}") from None
    return Pose(head.position + head.rotation @ offset, head.rotation)


@functools.cache  # read several times in each step
def _offsets(head_size: float) -> dict[str, Floats]:
    """Return where the organs of a head are in its frame, each ``(3,)`` metres, read-only."""
    offsets = {name: np.array(offset) * head_size for name, offset in MOUNTS_M.items()}
    for offset in offsets.values():
        offset.setflags(write=False)
    return offsets


def other_eye_m(name: str, head_size: float) -> float:
    """Return the way from an eye to the other one along the left axis of the head, metres."""
    return -2.0 * MOUNTS_M[name][1] * head_size


class Gaze:
    """The state of both eyes: a point at which they look, and the distance of focus.

    Args:
        range_rad: Largest rotation of the eyes in the head.
        head_size: `Growth.head_size` of the body.

    Attributes:
        point: ``(3,)`` metres in the world frame; None when the eyes look straight ahead.
        focal_distance_m: To which the lenses are adjusted; ``inf`` when relaxed.
    """

    def __init__(self, range_rad: float, head_size: float = 1.0) -> None:
        self._range_rad, self._head_size = range_rad, head_size
        self.relax()

    def relax(self) -> None:
        """Look straight ahead with relaxed lenses."""
        self.point: Floats | None = None
        self.focal_distance_m = math.inf

    def look_toward(self, point: Floats | tuple[float, float, float]) -> None:
        """Look at a point from now on; raise `ValueError` unless it is three finite numbers."""
        target = np.array(point, dtype=np.float64)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise ValueError(f"cannot look toward {point!r}: three finite metres are needed")
        self.point = target

    def adjust(self, focal_distance_m: float) -> None:
        """Focus at a distance; raise `ValueError` unless it is positive."""
        if not focal_distance_m > 0:
            raise ValueError(f"focal distance {focal_distance_m} must be positive metres or inf")
        self.focal_distance_m = float(focal_distance_m)

    def turned(self, name: str, eye: Pose) -> Pose:
        """Return the pose of an eye, given its name and its pose when it looks straight ahead."""
        if self.point is None:
            return eye
        aside_m = MOUNTS_M[name][1] * self._head_size
        return aimed(eye, self.point, self._range_rad, aside_m)


def aimed(eye: Pose, point: Floats, range_rad: float, aside_m: float = 0.0) -> Pose:
    """Rotate an eye toward a point within its range.

    The vertical axis of the image stays in the sagittal plane of the head (Helmholtz coordinates:
    pitch about the axis through both eyes, then yaw): both eyes that look at a point share that
    axis, and what lies in the plane of both lines of sight is in the same row of both images. With
    yaw before pitch (Fick coordinates) the images of a near point below would be rolled against
    each other, by 18 degrees at a pitch of 50 and 24 degrees between the lines of sight.

    Args:
        eye: Pose of the eye when it looks straight ahead.
        point: ``(3,)`` metres, world frame.
        range_rad: Largest pitch and largest yaw, below 90 degrees.
        aside_m: Distance of the eye to the left of the sagittal plane. Both eyes turn to the side
            of this plane on which a point behind them is.

    Returns:
        The pose with its x axis toward `point`; pitch and yaw are clipped to the range. Both eyes
        have the same pitch at the limit, too, since they are beside each other.
    """
    x, y, z = eye.rotation.T @ (point - eye.position)
    pitch = min(max(math.atan2(z, abs(x)), -range_rad), range_rad)
    ahead = math.copysign(math.hypot(x, z), x)  # negative where the point is behind
    left = y if x >= 0.0 else y + aside_m
    yaw = math.copysign(min(abs(math.atan2(y, ahead)), range_rad), left)
    return Pose(eye.position, eye.rotation @ _pitched_and_yawed(pitch, yaw))


def _pitched_and_yawed(pitch: float, yaw: float) -> Floats:
    """Return the rotation ``(3, 3)`` by a pitch upwards about y, then a yaw to the left about z."""
    up, ahead = math.sin(pitch), math.cos(pitch)
    left, straight = math.sin(yaw), math.cos(yaw)
    return np.array(
        [
            [ahead * straight, -ahead * left, -up],
            [left, straight, 0.0],
            [up * straight, -up * left, ahead],
        ]
    )


def palm_centre(hand: Bone) -> Floats:
    """Return the centre of the palm's surface in the frame of a hand, ``(3,)`` metres.

    Raises:
        ValueError: If the bone has no box; hands are modelled as boxes.
    """
    for part in hand.colliders:
        if part.shape is Shape.BOX:
            # palms face the thighs of a standing body: -y on the left side, +y on the right
            inward = -1.0 if hand.name.startswith("l_") else 1.0
            x, y, z = part.pose.position
            return np.array([x, y + inward * (part.size[1] + hand.skin_thickness_m), z])
    raise ValueError(f"{hand.name} is no hand: it has no box")


_BOX_MARGIN_M = 0.3  # more than the margins of Bullet's boxes and the motion of a prop in a step


class Visible(Protocol):
    """What eyes can look for: a prop or a body.

    Attributes:
        object_id: Its id in the scene.
    """

    object_id: int


class Sight(Protocol):
    """The present images of the open eyes of a body. `EyeViews` is one."""

    def is_visible(self, object_id: int, eye: str | None = None) -> bool:
        """Return whether a pixel shows an object, also through transparent ones.

        Args:
            object_id: Its id in the scene.
            eye: One of the open eyes; None is any of them.

        Raises:
            ValueError: If this is not an open eye.
        """
        ...

    def front_objects(self) -> Mapping[int, float]:
        """Return the ids of all objects that are the foremost ones in at least one pixel.

        Objects that are seen only through transparent ones are left out.

        Returns:
            The smallest distance from the centre of an image for each, in pixels.
        """
        ...


def interactable_props(
    sight: Sight, eyes: Floats, props: Iterable[Prop], range_m: float
) -> list[Prop]:
    """Return the props that can be interacted with, the nearest to the centre of the view first.

    These declare an interaction, are visible and not only through transparent objects, and nearer
    than the range. The order of equally near ones is that of `props`.

    Args:
        sight: The images of the eyes.
        eyes: ``(3,)`` metres: the place from which distances are measured.
        props: Those to choose from.
        range_m: The distance to the bounding box of a prop must be smaller.
    """
    near = [
        prop
        for prop in props
        if prop.cfg.interactions
        and _may_be_nearer(prop, eyes, range_m)
        and distance_m(prop, eyes) < range_m
    ]
    if not near:
        return []
    front = sight.front_objects()
    seen = [prop for prop in near if prop.object_id in front]
    return sorted(seen, key=lambda prop: front[prop.object_id])


def _may_be_nearer(prop: Prop, point: Floats, range_m: float) -> bool:
    """Return False for a prop of which the bounding box is certainly farther from a point.

    This takes a tenth of the time of `distance_m`, and most props of a house are far away. The
    corners of a box along the world's axes are at most sqrt(3) times as far from the origin of the
    prop's frame as its own points.
    """
    reach_m = math.sqrt(3.0) * prop.extent_m + _BOX_MARGIN_M
    return math.dist(prop.position, point) < range_m + reach_m


def distance_m(prop: Prop, point: Floats) -> float:
    """Return the distance from a point to the bounding box of a prop along the world's axes."""
    low, high = prop.bounds()
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high))))

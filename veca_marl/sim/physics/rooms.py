"""Rooms and doors of a playground as data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.props import JointKind, check_appearance


@dataclass
class RoomCfg:
    """A box of air between walls: an acoustic room and a place to start from.

    Attributes:
        name: Unique in its playground.
        lower_m: The lower corner, metres.
        size_m: Extent along x, y and z, metres.
        reflection: Pressure reflection coefficient beta of its walls in [0, 1)
            (Allen & Berkley 1979); 0 is a room without echo.
        floor_colour: Red, green, blue in [0, 1] of its floor; None shows that of the playground.
    """

    name: str = "room"
    lower_m: tuple[float, float, float] = (-3.0, -3.0, 0.0)
    size_m: tuple[float, float, float] = (6.0, 6.0, 2.6)
    reflection: float = 0.5
    floor_colour: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check that the room has a volume and that sound decays in it."""
        if not all(math.isfinite(corner) for corner in self.lower_m):
            raise ValueError(f"room {self.name!r}: lower_m={tuple(self.lower_m)} must be finite")
        if not all(math.isfinite(size) and size > 0 for size in self.size_m):
            raise ValueError(f"room {self.name!r}: size_m={tuple(self.size_m)} must be positive")
        if not 0.0 <= self.reflection < 1.0:
            raise ValueError(f"room {self.name!r}: reflection={self.reflection} is not in [0, 1)")
        if self.floor_colour is not None:
            check_appearance(f"room {self.name!r}: ", self.floor_colour, 0.0, "floor_")

    def contains(self, position: Floats, margin_m: float = 0.0) -> bool:
        """Return whether a point is inside, `margin_m` or more from walls, floor and ceiling."""
        low = np.asarray(self.lower_m) + margin_m
        high = np.asarray(self.lower_m) + np.asarray(self.size_m) - margin_m
        return bool(np.all(position >= low) and np.all(position <= high))

    def distance_m(self, point: tuple[float, float]) -> float:
        """Return the distance of a point ``(x, y)`` of the floor plan to the room; 0 inside."""
        low, size = np.array(self.lower_m[:2]), np.array(self.size_m[:2])
        out = np.maximum(np.maximum(low - point, point - low - size), 0.0)
        return float(np.linalg.norm(out))

    def overlap_m3(self, other: RoomCfg) -> float:
        """Return the volume that two rooms share; rooms that only touch share none."""
        low = np.maximum(self.lower_m, other.lower_m)
        upper = [np.add(room.lower_m, room.size_m) for room in (self, other)]
        return float(np.prod(np.maximum(np.minimum(*upper) - low, 0.0)))

    def gap_m(self, other: RoomCfg, axis: int) -> float:
        """Return how far two rooms are apart along an axis; negative where they overlap."""
        low, far = self.lower_m[axis], other.lower_m[axis]
        return max(far - low - self.size_m[axis], low - far - other.size_m[axis])

    @property
    def extent(self) -> str:
        """Its length and width for messages, such as ``6 x 4.5 m``."""
        return f"{self.size_m[0]:g} x {self.size_m[1]:g} m"

    @property
    def middle_m(self) -> Floats:
        """``(3,)`` metres: the middle of the floor."""
        x, y = np.array(self.lower_m[:2]) + np.array(self.size_m[:2]) / 2.0
        return np.array([x, y, self.lower_m[2]])

    def sample_floor(self, rng: np.random.Generator, margin_m: float) -> Floats:
        """Draw a point of the floor, ``(3,)`` metres, `margin_m` or more from the walls.

        Raises:
            ValueError: If the room is too small for that margin.
        """
        low, size = np.asarray(self.lower_m), np.asarray(self.size_m)
        if not size[:2].min() >= 2.0 * margin_m:
            raise ValueError(self._too_small(margin_m))
        point = rng.uniform(low[:2] + margin_m, low[:2] + size[:2] - margin_m)
        return np.array([point[0], point[1], low[2]])

    def sample_start(self, rng: np.random.Generator, margin_m: float) -> tuple[Floats, float]:
        """Draw a place to run from: near the edge of the floor, facing the room's middle.

        Returns:
            The point ``(3,)`` metres, on a circle whose distance to the nearest wall is
            `margin_m`, and the heading (rad) to the middle.

        Raises:
            ValueError: If the room is too small for that margin.
        """
        low, size = np.asarray(self.lower_m), np.asarray(self.size_m)
        radius = size[:2].min() / 2.0 - margin_m
        if radius < 0.0:
            raise ValueError(self._too_small(margin_m))
        heading = rng.uniform(-math.pi, math.pi)
        back = np.array([math.cos(heading), math.sin(heading)]) * radius
        x, y = low[:2] + size[:2] / 2.0 - back
        return np.array([x, y, low[2]]), heading

    def _too_small(self, margin_m: float) -> str:
        return (
            f"room {self.name!r}: size_m={tuple(self.size_m)} leaves no floor {margin_m} m "
            "away from the walls"
        )


@dataclass
class LeafCfg:
    """The leaf of a door, a prop with the name of the door after ``leaf_``.

    Attributes:
        kind: A hinge turns it by 90 degrees, where it must not meet walls or furniture; a slide
            moves it into the wall beside the opening, which has to be as long as the leaf, and must
            not meet another wall or leaf there.
        opening: Opening at the start of an episode, from 0 (closed) to 1.
        opens_to_front: Whether it opens to the side of greater x or y, across the wall for a hinge
            and along it for a slide; otherwise to the other.
        key: Name of the prop that unlocks it; empty for none.
        locked: Whether it is locked at the start of an episode; a locked leaf does not move.
        colour: Red, green, blue in [0, 1].
    """

    kind: JointKind = JointKind.hinge
    opening: float = 1.0
    opens_to_front: bool = True
    key: str = ""
    locked: bool = False
    colour: tuple[float, float, float] = (0.80, 0.62, 0.42)

    def __post_init__(self) -> None:
        """Check the opening and the colour."""
        if not 0.0 <= self.opening <= 1.0:
            raise ValueError(f"leaf of a door: opening={self.opening} is not in [0, 1]")
        check_appearance("leaf of a door: ", self.colour, 0.0)


@dataclass
class DoorCfg:
    """An opening in the wall between two rooms, as data for tasks and experts.

    The walls round it are props, or built by `PlaygroundCfg.walls`.

    Attributes:
        name: Unique in its playground.
        rooms: The names of the two rooms it joins.
        position_m: The middle of its threshold, x and y, metres.
        width_m: Its width.
        leaf: What closes it; None for an opening. It needs `PlaygroundCfg.walls`.
    """

    name: str = "door"
    rooms: tuple[str, str] = ("", "")
    position_m: tuple[float, float] = (0.0, 0.0)
    width_m: float = 1.0
    leaf: LeafCfg | None = None

    def __post_init__(self) -> None:
        """Check the numbers and that the rooms are two."""
        if not all(math.isfinite(value) for value in self.position_m):
            raise ValueError(
                f"door {self.name!r}: position_m={tuple(self.position_m)} must be finite"
            )
        if not (math.isfinite(self.width_m) and self.width_m > 0.0):
            raise ValueError(f"door {self.name!r}: width_m={self.width_m} must be positive")
        if self.rooms[0] == self.rooms[1]:
            raise ValueError(f"door {self.name!r}: rooms={tuple(self.rooms)} must be two")

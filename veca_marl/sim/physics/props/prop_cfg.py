"""Props as data: what stands, lies or rolls in a room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

from veca_marl.sim.sound import SoundCfg
from veca_marl.sim.sound.impacts import Material


class PropShape(Enum):
    """Shapes of props. `SIZE_NAMES` says what `PropCfg.size_m` means for each."""

    sphere = "sphere"
    box = "box"
    cylinder = "cylinder"
    capsule = "capsule"
    wall = "wall"
    goal = "goal"


SIZE_NAMES: dict[PropShape, tuple[str, ...]] = {
    PropShape.sphere: ("radius",),
    PropShape.box: ("length_x", "length_y", "height"),
    PropShape.cylinder: ("radius", "height"),
    PropShape.capsule: ("radius", "length"),
    PropShape.wall: ("length", "thickness", "height"),
    PropShape.goal: ("width", "height", "bar_radius"),
}


def check_appearance(
    prefix: str, colour: Sequence[float], checker_m: float, field_prefix: str = ""
) -> None:
    """Check a colour and the edge of a checker pattern.

    Raises:
        ValueError: If the colour is not three numbers in [0, 1], or the edge is negative or not
            finite; the message begins with `prefix` and the name of the field.
    """
    if len(colour) != 3 or not all(0.0 <= channel <= 1.0 for channel in colour):
        raise ValueError(
            f"{prefix}{field_prefix}colour={tuple(colour)} must be red, green and blue in [0, 1]"
        )
    if not (math.isfinite(checker_m) and checker_m >= 0.0):
        raise ValueError(
            f"{prefix}{field_prefix}checker_m={checker_m} must be an edge in metres, or 0 (plain)"
        )


@dataclass
class PropCfg:
    """One prop.

    Attributes:
        name: Unique in its world.
        shape: Its shape.
        size_m: Lengths in metres, see `SIZE_NAMES`: a box has full edge lengths, a capsule the
            distance of its cap centres. Cylinders, capsules and goal posts stand along z.
        position_m: Centre of the shape; for walls and goals the middle of the foot line.
        yaw_deg: Rotation about z.
        mass_kg: 0 makes it a fixed part of the world. The inertia is that of a homogeneous solid.
        friction: Sliding friction coefficient (Coulomb) on the floor. Bullet multiplies those of
            two objects in contact; the floor's is 1.
        rolling_friction: Lever arm of the resistance to rolling and to spinning on the floor,
            metres.
        restitution: 0 (no rebound) to 1 (rebound at equal speed) on the floor; multiplied as
            well, the floor's is 1. Speeds of rebound are within 0.1 of the product times the speed
            of impact; with a product above 0.8 an object can rebound higher than it was.
        colour: Red, green, blue in [0, 1].
        checker_m: Edge of a checker pattern, which is fixed to the prop; 0 is plain.
        transparent: Whether eyes see through it; it does not hinder `is_visible`.
        tangible: Whether it collides, is felt and stops sound; a mark on the floor is only seen.
        sound: What it emits; None for a silent prop.
        material: How it sounds when it is hit, see `ImpactCfg`; it does not change the mass.
        interactions: Names of the verbs that bodies can apply to it, such as ``[grab]``; see
            `veca_marl.sim.physics.interactions`.
    """

    name: str = ""
    shape: PropShape = PropShape.box
    size_m: list[float] = field(default_factory=list)
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    mass_kg: float = 0.0
    friction: float = 0.6
    rolling_friction: float = 0.001
    restitution: float = 0.3
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    checker_m: float = 0.0
    transparent: bool = False
    tangible: bool = True
    sound: SoundCfg | None = None
    material: Material = Material.wood
    interactions: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the numbers."""
        self._check_shape()
        self._check_appearance()
        self._check_physics()
        if not self.name:
            raise ValueError(f"a {self.shape.value} without a name; every prop has one")

    def _check_shape(self) -> None:
        if not isinstance(self.shape, PropShape):
            shapes = [shape.name for shape in PropShape]
            raise ValueError(f"prop {self.name!r}: shape={self.shape!r}; there are {shapes}")
        if not isinstance(self.material, Material):
            materials = [material.name for material in Material]
            raise ValueError(
                f"prop {self.name!r}: material={self.material!r}; there are {materials}"
            )
        names = SIZE_NAMES[self.shape]
        if len(self.size_m) != len(names) or not all(
            math.isfinite(size) and size > 0 for size in self.size_m
        ):
            raise ValueError(
                f"prop {self.name!r}: size_m={list(self.size_m)} of a {self.shape.value} "
                f"must be {len(names)} positive lengths: {', '.join(names)}"
            )
        if not all(math.isfinite(value) for value in (*self.position_m, self.yaw_deg)):
            raise ValueError(
                f"prop {self.name!r}: position_m={tuple(self.position_m)}, yaw_deg={self.yaw_deg} "
                "must be finite"
            )

    def _check_appearance(self) -> None:
        check_appearance(f"prop {self.name!r}: ", self.colour, self.checker_m)

    def _check_physics(self) -> None:
        for quantity in ("mass_kg", "friction", "rolling_friction"):
            value = getattr(self, quantity)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"prop {self.name!r}: {quantity}={value} is not 0 or more")
        if not 0.0 <= self.restitution <= 1.0:
            raise ValueError(f"prop {self.name!r}: restitution={self.restitution} is not in [0, 1]")
        if not self.tangible and self.mass_kg > 0.0:
            raise ValueError(
                f"prop {self.name!r}: mass_kg={self.mass_kg}, but a prop that is not tangible "
                "would fall through the floor: it must be fixed (mass_kg=0)"
            )

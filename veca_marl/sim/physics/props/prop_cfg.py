"""Props as data: what stands, lies or rolls in a room."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from veca_marl.sim.physics.props.joint_cfg import JointCfg
from veca_marl.sim.physics.props.part_cfg import PartCfg
from veca_marl.sim.physics.props.prop_shape import (
    PropShape,
    check_appearance,
    check_piece,
    check_shape,
)
from veca_marl.sim.sound import SoundCfg
from veca_marl.sim.sound.modal_synthesis import Material

_BOXES = {PropShape.box, PropShape.wall}


@dataclass
class PropCfg:
    """One prop.

    Attributes:
        name: Unique in its world.
        shape: Its shape.
        size_m: Lengths in metres, see `SIZE_NAMES`: a box has full edge lengths, a capsule the
            distance of its cap centres. Cylinders, capsules, goal posts and the flat sides of
            sectors face along z, the tips of pyramids point up.
        position_m: Centre of the shape; for walls and goals the middle of the foot line; for
            sectors the tip at half of the height; for compound and convex props the origin of
            their parts and points.
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
        partition: Whether it fills an opening in a wall, as the leaf of a door does: its largest
            box attenuates sound at any size. Walls do so too, and of other props large boxes.
        sound: What it emits; None for a silent prop.
        angle_deg: Angle of a sector of a disc, in (0, 180], halved by the x axis.
        parts: The parts of a compound prop.
        points_m: Points ``[x, y, z]`` in metres, of which a convex prop is the hull; in YAML with
            decimal points (``0.0``).
        joint: How it is attached, see `JointCfg`; None for a prop that is fixed or free.
        material: How it sounds when it is hit, see `ImpactCfg`; it does not change the mass.
        interactions: Names of the verbs that bodies can apply to it, such as ``[grab]``; see
            `veca_marl.sim.physics.interactions`.
    """

    # fields that were added later, with the value that props had before
    formerly: ClassVar[dict[str, Any]] = {"partition": False}

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
    partition: bool = False
    sound: SoundCfg | None = None
    material: Material = Material.wood
    interactions: list[str] = field(default_factory=list)
    angle_deg: float = 90.0
    parts: list[PartCfg] = field(default_factory=list)
    points_m: list[list[float]] = field(default_factory=list)
    joint: JointCfg | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        self._check_shape()
        self._check_pieces()
        self._check_appearance()
        self._check_physics()
        if not self.name:
            raise ValueError(f"a {self.shape.value} without a name; every prop has one")

    def _check_shape(self) -> None:
        check_shape(f"prop {self.name!r}: ", self.shape, self.size_m)
        if not isinstance(self.material, Material):
            materials = [material.name for material in Material]
            raise ValueError(
                f"prop {self.name!r}: material={self.material!r}; there are {materials}"
            )
        if not all(math.isfinite(value) for value in (*self.position_m, self.yaw_deg)):
            raise ValueError(
                f"prop {self.name!r}: position_m={tuple(self.position_m)}, yaw_deg={self.yaw_deg} "
                "must be finite"
            )

    def _check_pieces(self) -> None:
        if (self.shape is PropShape.compound) != bool(self.parts):
            raise ValueError(
                f"prop {self.name!r}: parts={self.parts} of a {self.shape.name}; "
                "a compound has at least one part, other shapes have none"
            )
        check_piece(f"prop {self.name!r}: ", self)
        shapes = {self.shape, *(part.shape for part in self.parts)}
        if self.partition and not shapes & _BOXES:
            raise ValueError(
                f"prop {self.name!r}: partition=true of a {self.shape.name} without a box; a "
                "partition is a box or a compound with one"
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
        if self.joint is not None and not (self.mass_kg > 0.0 and self.tangible):
            raise ValueError(
                f"prop {self.name!r}: mass_kg={self.mass_kg}, tangible={self.tangible}; a prop "
                "with a joint needs a positive mass and is tangible"
            )

"""Props as data: their shapes and what their sizes mean, parts of compounds, and whole props."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from veca_marl.sim.geometry import Polyhedron, convex_hull, pyramid, sector_of_disc
from veca_marl.sim.physics.bullet import HULL_MARGIN_M
from veca_marl.sim.physics.props.joint import JointCfg
from veca_marl.sim.sound import SoundCfg
from veca_marl.sim.sound.modal_synthesis import Material


class PropShape(Enum):
    """Shapes of props. `SIZE_NAMES` says what `PropCfg.size_m` means for each."""

    sphere = "sphere"
    box = "box"
    cylinder = "cylinder"
    capsule = "capsule"
    wall = "wall"
    goal = "goal"
    pyramid = "pyramid"
    sector = "sector"
    doll = "doll"
    compound = "compound"
    convex = "convex"


SIZE_NAMES: dict[PropShape, tuple[str, ...]] = {
    PropShape.sphere: ("radius",),
    PropShape.box: ("length_x", "length_y", "height"),
    PropShape.cylinder: ("radius", "height"),
    PropShape.capsule: ("radius", "length"),
    PropShape.wall: ("length", "thickness", "height"),
    PropShape.goal: ("width", "height", "bar_radius"),
    PropShape.pyramid: ("length_x", "length_y", "height"),
    PropShape.sector: ("radius", "height"),
    PropShape.doll: ("height",),
    PropShape.compound: (),
    PropShape.convex: (),
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


def check_shape(prefix: str, shape: PropShape, size_m: Sequence[float]) -> None:
    """Check a shape and its sizes.

    Raises:
        ValueError: If there is no such shape, or the sizes are not positive or not as many as
            `SIZE_NAMES` lists; the message begins with `prefix`.
    """
    if not isinstance(shape, PropShape):
        raise ValueError(f"{prefix}shape={shape!r}; there are {[one.name for one in PropShape]}")
    names = SIZE_NAMES[shape]
    if len(size_m) != len(names) or not all(math.isfinite(size) and size > 0 for size in size_m):
        lengths = ", ".join(names) or "none: its size is that of its parts or points"
        raise ValueError(
            f"{prefix}size_m={list(size_m)} of a {shape.value} "
            f"must be {len(names)} positive lengths: {lengths}"
        )


POLYHEDRA = (PropShape.pyramid, PropShape.sector, PropShape.convex)
"""Shapes with flat faces other than boxes; they collide as convex hulls, see `collision_shapes`."""


class Piece(Protocol):
    """What the geometry of a prop or part of one primitive depends on; see `PropCfg`."""

    @property
    def shape(self) -> PropShape:
        """The shape."""
        ...

    @property
    def size_m(self) -> Sequence[float]:
        """Its sizes, metres, see `SIZE_NAMES`."""
        ...

    @property
    def angle_deg(self) -> float:
        """Angle of a sector, in (0, 180]."""
        ...

    @property
    def points_m(self) -> Sequence[Sequence[float]]:
        """Points ``(n, 3)``, metres, of which a convex piece is the hull."""
        ...


def hull_of(piece: Piece) -> Polyhedron:
    """Return the polyhedron of a pyramid, sector or convex piece.

    Raises:
        ValueError: If the points have no hull with a volume.
    """
    if piece.shape is PropShape.pyramid:
        return pyramid(*piece.size_m)
    if piece.shape is PropShape.sector:
        return sector_of_disc(piece.size_m[0], piece.size_m[1], piece.angle_deg)
    return convex_hull(piece.points_m)


def check_piece(prefix: str, piece: Piece) -> None:
    """Check the angle of a sector, the points of a convex piece, and that a hull is not too thin.

    Raises:
        ValueError: If the angle is not in (0, 180], the points have no hull with a volume, or
            nothing is left of a hull without Bullet's margin; the message begins with `prefix`.
    """
    shape, points_m = piece.shape, piece.points_m
    if shape is PropShape.sector and not 0.0 < piece.angle_deg <= 180.0:
        raise ValueError(f"{prefix}angle_deg={piece.angle_deg} of a sector is not in (0, 180]")
    if (shape is PropShape.convex) != bool(points_m):
        raise ValueError(
            f"{prefix}points_m={points_m} of a {shape.name}; only convex props have points"
        )
    if shape in POLYHEDRA:
        _check_hull(prefix, piece)


def _check_hull(prefix: str, piece: Piece) -> None:
    try:
        hull = hull_of(piece)
    except ValueError as error:
        raise ValueError(f"{prefix}points_m: {error}") from None
    try:
        hull.grown(-HULL_MARGIN_M)
    except ValueError:
        numbers = {
            PropShape.pyramid: f"size_m={list(piece.size_m)}",
            PropShape.sector: f"size_m={list(piece.size_m)}, angle_deg={piece.angle_deg}",
            PropShape.convex: f"points_m={[list(point) for point in piece.points_m]}",
        }[piece.shape]
        raise ValueError(
            f"{prefix}{numbers}: a {piece.shape.name} that thin cannot collide; its centroid has "
            f"to be more than {HULL_MARGIN_M * 1e3:g} mm from each face"
        ) from None


SINGLE_SHAPES = (
    PropShape.sphere,
    PropShape.box,
    PropShape.cylinder,
    PropShape.capsule,
    PropShape.pyramid,
    PropShape.sector,
    PropShape.convex,
)
"""Shapes of one primitive each, which a compound can be made of."""


@dataclass
class PartCfg:
    """One part of a compound prop. All parts have the same density.

    Attributes:
        shape: One of `SINGLE_SHAPES`.
        size_m: Lengths in metres, see `SIZE_NAMES`.
        position_m: Centre of the part in the frame of the prop.
        rotation_deg: Rotations of the part about the x, y and z axis of the prop, one after the
            other.
        colour: Red, green, blue in [0, 1]; None is that of the prop.
        angle_deg: See `PropCfg.angle_deg`.
        points_m: See `PropCfg.points_m`.
    """

    shape: PropShape = PropShape.box
    size_m: list[float] = field(default_factory=list)
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: tuple[float, float, float] | None = None
    angle_deg: float = 90.0
    points_m: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_shape("part: ", self.shape, self.size_m)
        if self.shape not in SINGLE_SHAPES:
            names = [shape.name for shape in SINGLE_SHAPES]
            raise ValueError(f"part: shape={self.shape.name}; a part is one of {names}")
        check_piece("part: ", self)
        if not all(math.isfinite(value) for value in (*self.position_m, *self.rotation_deg)):
            raise ValueError(
                f"part: position_m={tuple(self.position_m)}, "
                f"rotation_deg={tuple(self.rotation_deg)} must be finite"
            )
        if self.colour is not None:
            check_appearance("part: ", self.colour, 0.0)


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

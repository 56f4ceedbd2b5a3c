"""The shapes of props and what their sizes mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Protocol

from veca_marl.sim.geometry import Polyhedron, convex_hull, pyramid, sector_of_disc
from veca_marl.sim.physics.collision_shapes import HULL_MARGIN_M


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

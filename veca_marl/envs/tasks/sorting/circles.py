"""Circles on the floor that are filled with fraction pieces, and which pieces fill them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from veca_marl.envs.tasks.sorting.items import Colour, built_at, place_on_floor
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, PropCfg, PropShape, World
from veca_marl.sim.physics.props.toys import fraction_piece

RADIUS_M = 0.2
_RIM_M, _PLATE_M, _PIECE_M = 0.02, 0.02, 0.04
REACH_M = RADIUS_M + _RIM_M
"""Radius of a circle with its rim."""
_PLATE_COLOUR = (0.25, 0.25, 0.28)
_COLOURS: dict[int, Colour] = {
    1: (0.9, 0.9, 0.9),
    2: (0.9, 0.12, 0.1),
    3: (0.1, 0.65, 0.2),
    4: (0.1, 0.25, 0.9),
    5: (0.6, 0.2, 0.75),
    6: (0.95, 0.85, 0.1),
    8: (0.95, 0.5, 0.1),
}
DENOMINATORS = tuple(_COLOURS)
"""Pieces are unit fractions; pieces of one size have one colour."""


class Piece(NamedTuple):
    """A piece of a circle.

    Attributes:
        prop: The prop; the tip of the sector is the origin of its frame.
        fraction: The share of a circle that it fills.
    """

    prop: Prop
    fraction: Fraction

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Lie on the floor with the middle of its outline over a point ``(3,)``, metres."""
        middle_m = RADIUS_M / 2.0 if self.fraction <= Fraction(1, 2) else 0.0
        x, y, z = floor
        tip = (x - middle_m * math.cos(yaw_rad), y - middle_m * math.sin(yaw_rad), z)
        self.prop.place((tip[0], tip[1], z + _PIECE_M / 2.0), yaw_rad)


def add_piece(world: World, number: int, denominator: int) -> Piece:
    """Add a piece of ``1 / denominator`` of a circle to a world that is not frozen yet."""
    fraction = Fraction(1, denominator)
    prop = fraction_piece(
        f"piece_{number}_of_{denominator}",
        float(fraction),
        built_at(number, 2.2 * RADIUS_M),
        radius_m=RADIUS_M,
        height_m=_PIECE_M,
        colour=_COLOURS[denominator],
    )
    return Piece(world.add_prop(prop), fraction)


class Circle:
    """A round plate on the floor, into which pieces are put with the verb `put_into`.

    Pieces in it lie side by side from one radius on, in the order in which they were put in, and
    are not moved by contacts. It refuses a piece that would overfill it.

    Args:
        world: A world that is not frozen yet.
        name: Name of the plate.
        pieces: All pieces of the world.

    Attributes:
        prop: The plate.
        content: The pieces in it.
    """

    def __init__(self, world: World, name: str, pieces: Sequence[Piece]) -> None:
        self.prop = world.add_prop(
            PropCfg(
                name=name,
                shape=PropShape.cylinder,
                size_m=[REACH_M, _PLATE_M],
                position_m=(0.0, 0.0, _PLATE_M / 2.0),
                colour=_PLATE_COLOUR,
                interactions=["put_into"],
            )
        )
        self.prop.accepts = self._accepts
        self._pieces = {piece.prop.name: piece for piece in pieces}
        self.content: list[Piece] = []

    @property
    def filled(self) -> Fraction:
        """The share of the circle that is filled, in [0, 1]."""
        return sum((piece.fraction for piece in self.content), Fraction(0))

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Lie empty on a point ``(3,)`` of the floor, metres."""
        self.content = []
        place_on_floor(self.prop, floor, yaw_rad)

    def put(self, prop: Prop) -> None:
        """Take in a piece that was accepted; `arrange` lays it into its place."""
        self.content.append(self._pieces[prop.name])

    def arrange(self) -> None:
        """Give up the pieces that were grabbed, and lay the others side by side."""
        self.content = [piece for piece in self.content if piece.prop.holder is None]
        x, y, z = self.prop.position
        angle_rad = math.atan2(*self.prop.rotation[1::-1, 0])
        for piece in self.content:
            half_rad = math.pi * float(piece.fraction)
            height_m = z + (_PLATE_M + _PIECE_M) / 2.0
            piece.prop.place((x, y, height_m), angle_rad + half_rad)
            angle_rad += 2.0 * half_rad

    def _accepts(self, prop: Prop) -> bool:
        piece = self._pieces.get(prop.name)
        return piece is not None and self.filled + piece.fraction <= 1


def division(denominators: Sequence[int], circles: int) -> list[int] | None:
    """Return which circle each piece can be put into so that all circles are full.

    Args:
        denominators: The pieces are ``1 / denominator``; all of them are used.
        circles: Number of circles.

    Returns:
        The number of a circle for each piece; None if there is no such division.
    """
    sizes = [Fraction(1, denominator) for denominator in denominators]
    if sum(sizes) != circles:
        return None
    order = sorted(range(len(sizes)), key=lambda number: -sizes[number])
    chosen = _assign([sizes[number] for number in order], [Fraction(1)] * circles)
    if chosen is None:
        return None
    return [circle for _, circle in sorted(zip(order, chosen, strict=True))]


def _assign(sizes: list[Fraction], room: list[Fraction]) -> list[int] | None:
    """Return a circle with enough room for each piece, the largest piece first (backtracking)."""
    if not sizes:
        return []
    for circle in range(len(room)):
        if room[circle] < sizes[0] or room[circle] in room[:circle]:
            continue  # circles with equal room are alike
        left = [*room[:circle], room[circle] - sizes[0], *room[circle + 1 :]]
        rest = _assign(sizes[1:], left)
        if rest is not None:
            return [circle, *rest]
    return None

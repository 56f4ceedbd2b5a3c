"""FillFraction: fill three circles with fraction pieces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, register_task, require_walker, terms
from veca_marl.envs.tasks.floors.places import (
    Spacing,
    furniture_of,
    place_player,
    planned_furniture,
    scattered_places,
    wide_rooms,
)
from veca_marl.envs.tasks.floors.playability import check_connected, check_placement
from veca_marl.envs.tasks.sorting.sorting_task import Colour, built_at, place_on_floor
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World
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


_PASSAGE_M = 0.3  # from walls and furniture to the rim of a circle: an agent passes
_DOOR_M = 0.9


def _default_pieces() -> list[int]:
    return [2, 2, 2, 4, 4, 3, 3, 3]


@dataclass
class FillFractionCfg(TaskCfg):
    """Parameters of FillFraction. Only the number of circles is in the paper.

    Attributes:
        circles: Number of circles.
        pieces: The denominators of the pieces: 4 is a quarter of a circle. All of them together
            must be able to fill all circles.
        apart_m: Least distance between any two of the pieces, the circles and the start.
    """

    max_seconds: float = 90.0
    circles: int = 3
    pieces: list[int] = field(default_factory=_default_pieces)
    apart_m: float = 0.75
    weights: dict[str, float] = terms(filled=1.0, full=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("apart_m")
        if self.apart_m < 2.0 * REACH_M:
            raise ValueError(
                f"task.apart_m={self.apart_m} must be at least {2.0 * REACH_M:.2f}: "
                "circles must not overlap"
            )
        unknown = sorted(set(self.pieces) - set(DENOMINATORS))
        if unknown:
            raise ValueError(f"task.pieces: no {unknown}; choices: {list(DENOMINATORS)}")
        if self.circles < 1 or division(self.pieces, self.circles) is None:
            raise ValueError(
                f"task.pieces={list(self.pieces)} do not fill task.circles={self.circles} circles "
                "exactly"
            )


@register_task
class FillFraction(Task):
    """An agent has to fill three circles with pieces that are fractions of a circle.

    Circles and pieces lie at random positions. The agent grabs a piece with the verb `grab` and
    puts it into a circle with `put_into`: the piece, or the circle, nearest to the centre of its
    view, up to 1.5 m away. The piece is laid beside those that lie there already. A piece that
    would overfill the circle is refused: the verb has no effect. A piece can be taken out again.
    The episode terminates when all circles are full; then the task is solved (`solved`).

    Senses, actions (a continuous `move` and the discrete `verb`), the number of circles, the
    refusal, and that each piece and a full circle are rewarded are those of the paper (table of
    tasks in the appendix); a discrete `move` beside the verb is not in the paper. The paper does
    not state the pieces and the amounts. Here the reward for a piece is the fraction that it fills,
    so that every way to fill the circles has the same return; both rewards are changes of
    a score of the present state, so that taking pieces out and putting them in again has no return.
    Pieces are unit fractions, with one colour for each size. The head is pitched 25 degrees down,
    as in ColorSort.

    Terms:
        filled: Change of the sum of the filled fractions of all circles.
        full: Change of the number of full circles.
    """

    senses: ClassVar[tuple[str, ...]] = ("vision",)
    body_cfg = WalkerCfg
    verbs = ("grab", "put_into")
    cfg: FillFractionCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        count, spacing = 1 + cfg.circles + len(cfg.pieces), _spacing(cfg)
        furniture = planned_furniture(playground)
        check_connected(cls.__name__, playground, wide_rooms(playground.rooms, spacing.clear_m))
        check_placement(
            lambda rng: scattered_places(playground, furniture, count, spacing, rng),
            f"FillFraction with task.circles={cfg.circles}, {len(cfg.pieces)} task.pieces and "
            f"task.apart_m={cfg.apart_m:g}",
            "fewer or smaller ones, or a larger playground, such as playground=house",
        )

    def build(self) -> None:
        self.walker = require_walker(self.players[0])
        self._furniture = furniture_of(self.world)
        self.pieces = [
            add_piece(self.world, number, denominator)
            for number, denominator in enumerate(self.cfg.pieces)
        ]
        self.circles = [
            Circle(self.world, f"circle_{number}", self.pieces)
            for number in range(self.cfg.circles)
        ]
        self._held: Prop | None = None
        self._score = self._change = (Fraction(0), 0)

    def reset(self, rng: np.random.Generator) -> None:
        things: list[Circle | Piece] = [*self.circles, *self.pieces]
        start, *floors = scattered_places(
            self.world.playground, self._furniture, 1 + len(things), _spacing(self.cfg), rng
        )
        for thing, floor in zip(things, floors, strict=True):
            thing.place(floor, rng.uniform(-math.pi, math.pi))
        place_player(self.players[0], start, rng.uniform(-math.pi, math.pi))
        self._score = self._change = (Fraction(0), 0)

    def before_step(self, rng: np.random.Generator) -> None:
        self._held = self.walker.held

    def after_step(self, rng: np.random.Generator) -> None:
        self._lay_piece()
        for circle in self.circles:
            circle.arrange()
        shares = [circle.filled for circle in self.circles]
        filled, full = sum(shares, Fraction(0)), shares.count(Fraction(1))
        self._change = filled - self._score[0], full - self._score[1]
        self._score = filled, full

    def reward(self, player: Player) -> dict[str, float]:
        return {"filled": float(self._change[0]), "full": float(self._change[1])}

    def state(self) -> dict[str, float]:
        return {f"circle_{n}": float(circle.filled) for n, circle in enumerate(self.circles)}

    def terminated(self) -> bool:
        return self.solved(self.players[0])

    def solved(self, player: Player) -> bool:
        """Return whether all circles were full at the end of the last step."""
        return self._score[1] == len(self.circles)

    def _lay_piece(self) -> None:
        """Lay the piece that was put into a circle in this step into its place."""
        applied, piece = self.walker.applied_verb, self._held
        if applied is None or applied.verb != "put_into" or piece is None:
            return
        for circle in self.circles:
            if circle.prop is applied.prop:
                circle.put(piece)


def _spacing(cfg: FillFractionCfg) -> Spacing:
    return Spacing(REACH_M + _PASSAGE_M, cfg.apart_m, _DOOR_M)

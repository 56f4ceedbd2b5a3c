"""FillFraction: fill three circles with fraction pieces."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, register_task, require_walker, terms
from veca_marl.envs.tasks.floors.places import furniture_of, planned_furniture
from veca_marl.envs.tasks.floors.playability import check_connected
from veca_marl.envs.tasks.navigation.floors.scattering import (
    Spacing,
    scattered_places,
    wide_rooms,
)
from veca_marl.envs.tasks.navigation.placement_check import check_placement
from veca_marl.envs.tasks.player_starts import place_player
from veca_marl.envs.tasks.sorting.circles import (
    DENOMINATORS,
    REACH_M,
    Circle,
    Piece,
    add_piece,
    division,
)
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.physics import PlaygroundCfg, Prop

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

    Circles and pieces lie at random places. The agent grabs a piece with the verb `grab` and puts
    it into a circle with `put_into`: the piece, or the circle, nearest to the centre of its view,
    up to 1.5 m away. The piece is laid beside those that lie there already. A piece that would
    overfill the circle is refused: the verb has no effect. A piece can be taken out again. The
    episode terminates when all circles are full; then the task is solved (`solved`).

    Senses, actions (a continuous `move` and the discrete `verb`), the number of circles, the
    refusal, and that each piece and a full circle are rewarded are those of the paper (table of
    tasks in the appendix); a discrete `move` beside the verb is not in the paper. The paper does
    not state the pieces and the amounts. Here the reward for a piece is the fraction that it fills,
    so that every way to fill the circles has the same return; both rewards are changes of a score
    of the present state, so that taking pieces out and putting them in again has no return. Pieces
    are unit fractions, with one colour for each size. The head is pitched 25 degrees down, as in
    ColorSort.

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

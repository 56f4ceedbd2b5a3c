"""ShapeSort: put each toy into the basket of its shape."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from veca_marl.envs.core.task import register_task
from veca_marl.envs.tasks.sorting.sorting_task import (
    COLOURS,
    Basket,
    Item,
    SortingCfg,
    SortingTask,
    add_basket_with_sample,
    add_items,
)
from veca_marl.sim.physics.props.toys import ToyKind

_BASKET_COLOUR = (0.72, 0.55, 0.33)


def _default_shapes() -> list[str]:
    return ["sphere", "cube", "pyramid"]


@dataclass
class ShapeSortCfg(SortingCfg):
    """Parameters of ShapeSort. None of the numbers is in the paper.

    Attributes:
        shapes: The shapes, of sphere, cube, pyramid, cylinder and doll, at least 2.
    """

    shapes: list[str] = field(default_factory=_default_shapes)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_categories("shapes", self.shapes, [kind.name for kind in ToyKind])


@register_task
class ShapeSort(SortingTask):
    """An agent has to put toys into the baskets of their shapes.

    As ColorSort, but the shape of a toy determines its basket. Behind each basket a white toy of
    its shape stands on a stand, which cannot be taken. The colour of each toy is drawn for each
    episode and says nothing about its basket. The episode terminates when all toys are in the
    baskets of their shapes; then the task is solved (`solved`).

    Senses, actions (a continuous `move` and the discrete `verb`) and the reward for a toy that is
    put into the basket of its shape are those of the paper (table of tasks in the appendix); a
    discrete `move` beside the verb is not in the paper. The paper does not state the shapes, the
    numbers of toys and baskets, how a basket shows its shape, and what a wrong basket costs. As in
    ColorSort the reward is the change of a score of the present state, so that taking toys out and
    putting them in again has no return, and random choices among three baskets have a return of 0
    on average.

    Terms:
        sorted: Change of the number of toys in the baskets of their shapes.
        wrong: Change of the number of toys in other baskets.
    """

    cfg: ShapeSortCfg

    @classmethod
    def categories_of(cls, cfg: Any) -> list[str]:
        return list(cfg.shapes)

    def add_items(self) -> list[Item]:
        kinds = [ToyKind[name] for name in self.cfg.shapes for _ in range(self.cfg.items)]
        return add_items(self.world, kinds)

    def add_baskets(self) -> list[Basket]:
        return [
            add_basket_with_sample(self.world, f"basket_{name}", ToyKind[name], _BASKET_COLOUR)
            for name in self.cfg.shapes
        ]

    def draw_categories(self, rng: np.random.Generator) -> list[int]:
        colours = list(COLOURS.values())
        for item in self.items:
            item.paint(self.world, colours[int(rng.integers(len(colours)))])
        return [self.cfg.shapes.index(item.kind.name) for item in self.items]

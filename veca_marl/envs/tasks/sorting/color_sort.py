"""ColorSort: put each toy into the basket of its colour."""

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
    add_coloured_basket,
    add_items,
)
from veca_marl.sim.physics.props.toys import ToyKind

_KINDS = (ToyKind.sphere, ToyKind.cube, ToyKind.cylinder)


def _default_colours() -> list[str]:
    return ["red", "green", "blue"]


@dataclass
class ColorSortCfg(SortingCfg):
    """Parameters of ColorSort. None of the numbers is in the paper.

    Attributes:
        colours: The colours, of red, green, blue and yellow, at least 2.
    """

    colours: list[str] = field(default_factory=_default_colours)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_categories("colours", self.colours, COLOURS)


@register_task
class ColorSort(SortingTask):
    """An agent has to put toys into the baskets of their colours.

    Toys and baskets stand at random positions. The agent grabs a toy with the verb `grab` and puts
    it into a basket with `put_into`: the toy, or the basket, nearest to the centre of its view, up
    to 1.5 m away. The colour of each toy is drawn for each episode, so that its shape does not tell
    the basket. A toy can be taken out of a basket again. The episode terminates when all toys are
    in the baskets of their colours; then the task is solved (`solved`).

    Senses, actions (a continuous `move` and the discrete `verb`) and the reward for a toy that is
    put into the basket of its colour are those of the paper (table of tasks in the appendix); a
    discrete `move` beside the verb is not in the paper. The paper does not state the numbers of
    toys and baskets, nor what a wrong basket costs. Here the reward is the change of a score of the
    present state, so that taking toys out and putting them in again has no return. The default
    weight of a wrong basket is chosen such that random choices among three baskets have a return of
    0 on average. The head is pitched 25 degrees down, to see the floor from half a metre on.

    Terms:
        sorted: Change of the number of toys in the baskets of their colours.
        wrong: Change of the number of toys in other baskets.
    """

    cfg: ColorSortCfg

    @classmethod
    def categories_of(cls, cfg: Any) -> list[str]:
        return list(cfg.colours)

    def add_items(self) -> list[Item]:
        count = self.cfg.items * len(self.cfg.colours)
        return add_items(self.world, [_KINDS[number % len(_KINDS)] for number in range(count)])

    def add_baskets(self) -> list[Basket]:
        return [
            add_coloured_basket(self.world, f"basket_{name}", COLOURS[name])
            for name in self.cfg.colours
        ]

    def draw_categories(self, rng: np.random.Generator) -> list[int]:
        numbers = np.arange(len(self.items)) // self.cfg.items
        categories: list[int] = rng.permutation(numbers).tolist()
        for item, category in zip(self.items, categories, strict=True):
            item.paint(self.world, COLOURS[self.cfg.colours[category]])
        return categories

"""What ColorSort and ShapeSort have in common: toys, baskets, and the score."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, require_walker, terms
from veca_marl.envs.tasks.floors.places import (
    Spacing,
    furniture_of,
    place_player,
    planned_furniture,
    scattered_places,
    wide_rooms,
)
from veca_marl.envs.tasks.floors.playability import check_connected, check_placement
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import Floats, rotation_about_vertical
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World
from veca_marl.sim.physics.props.containers import basket
from veca_marl.sim.physics.props.toys import ToyKind, toy

Colour = tuple[float, float, float]

COLOURS: dict[str, Colour] = {
    "red": (0.9, 0.12, 0.1),
    "green": (0.1, 0.65, 0.2),
    "blue": (0.1, 0.25, 0.9),
    "yellow": (0.95, 0.85, 0.1),
}
"""Colours of toys and baskets."""

_ROW = 8  # things in a row in which they are built


class Item(NamedTuple):
    """A toy.

    Attributes:
        prop: The prop.
        kind: Its shape.
    """

    prop: Prop
    kind: ToyKind

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres."""
        place_on_floor(self.prop, floor, yaw_rad)

    def paint(self, world: World, colour: Colour) -> None:
        """Set the colour of all its parts until the next reset of the world."""
        world.scene.objects[self.prop.object_id].paint(colour)


def add_items(world: World, kinds: Sequence[ToyKind]) -> list[Item]:
    """Add toys that can be grabbed to a world that is not frozen yet, apart from each other."""
    return [
        Item(world.add_prop(toy(f"toy_{number}_{kind.name}", kind, built_at(number, 0.2))), kind)
        for number, kind in enumerate(kinds)
    ]


def built_at(number: int, spacing_m: float) -> tuple[float, float]:
    """Return a place ``(x, y)`` of a square grid beside the origin, metres."""
    return -2.0 + spacing_m * (number % _ROW), 1.0 + spacing_m * (number // _ROW)


def place_on_floor(prop: Prop, floor: Floats, yaw_rad: float) -> None:
    """Place a prop over a point ``(3,)`` of the floor, at the height of its configuration."""
    x, y, z = floor
    prop.place((x, y, z + prop.cfg.position_m[2]), yaw_rad)


_EDGE_M, _HEIGHT_M = 0.4, 0.15
_STAND_M = (0.16, 0.3)  # edge and height of the stand of a sample
_BEHIND_M = (_EDGE_M + _STAND_M[0]) / 2.0
_PILE_M = 0.4  # toys lie up to this height above the rim
_QUARTER_RAD = math.pi / 2.0
_STAND_COLOUR = (0.45, 0.35, 0.25)
_SAMPLE_COLOUR = (0.95, 0.95, 0.95)

REACH_M = math.hypot(_EDGE_M / 2.0 + _STAND_M[0], _EDGE_M / 2.0)
"""Radius of a circle about a basket with its stand."""


class Basket(NamedTuple):
    """An open box on the floor, into which toys are put with the verb `put_into`.

    Attributes:
        prop: The box.
        sign: A stand behind it with a sample of what it is for; may be empty.
    """

    prop: Prop
    sign: tuple[Prop, ...] = ()

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres, at the nearest multiple of 90 degrees."""
        yaw_rad = round(yaw_rad / _QUARTER_RAD) * _QUARTER_RAD
        place_on_floor(self.prop, floor, yaw_rad)
        behind = floor - _BEHIND_M * rotation_about_vertical(yaw_rad)[:, 0]
        for prop in self.sign:
            place_on_floor(prop, behind, yaw_rad)

    def contains(self, prop: Prop) -> bool:
        """Return whether the centre of a prop that no body holds is in the basket or above it."""
        if prop.holder is not None:
            return False
        x, y, z = self.prop.rotation.T @ (prop.position - self.prop.position)
        half_m = _EDGE_M / 2.0
        return bool(abs(x) <= half_m and abs(y) <= half_m and 0.0 <= z <= _HEIGHT_M + _PILE_M)


def add_coloured_basket(world: World, name: str, colour: Colour) -> Basket:
    """Add a basket of a colour to a world that is not frozen yet."""
    size_m = (_EDGE_M, _EDGE_M, _HEIGHT_M)
    return Basket(world.add_prop(basket(name, (0.0, 0.0), size_m=size_m, colour=colour)))


def add_basket_with_sample(world: World, name: str, kind: ToyKind, colour: Colour) -> Basket:
    """Add a basket with a white toy on a stand behind it to a world that is not frozen yet."""
    box = add_coloured_basket(world, name, colour)
    edge_m, height_m = _STAND_M
    stand = PropCfg(
        name=f"{name}.stand",
        shape=PropShape.box,
        size_m=[edge_m, edge_m, height_m],
        position_m=(0.0, 0.0, height_m / 2.0),
        colour=_STAND_COLOUR,
    )
    standing = toy(f"{name}.sample", kind, (0.0, 0.0), mass_kg=0.0, colour=_SAMPLE_COLOUR)
    x, y, z = standing.position_m
    sample = replace(standing, position_m=(x, y, z + height_m), interactions=[])
    return Basket(box.prop, (world.add_prop(stand), world.add_prop(sample)))


_PASSAGE_M = 0.3  # from walls and furniture to the surface of a basket: an agent passes
_DOOR_M = 0.9  # baskets nearer to the middle of a door could block it


@dataclass
class SortingCfg(TaskCfg):
    """Parameters of ColorSort and ShapeSort. None of the numbers is in the paper.

    Attributes:
        items: Number of toys for each basket, at least 1.
        apart_m: Least distance between any two of the toys, the baskets and the start.
    """

    max_seconds: float = 60.0
    items: int = 2
    apart_m: float = 0.85
    weights: dict[str, float] = terms(sorted=1.0, wrong=-0.5)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("apart_m")
        if self.items < 1:
            raise ValueError(f"task.items={self.items} must be at least 1")
        if self.apart_m < 2.0 * REACH_M:
            raise ValueError(
                f"task.apart_m={self.apart_m} must be at least {2.0 * REACH_M:.2f}: "
                "baskets must not overlap"
            )

    def check_categories(self, field: str, names: Sequence[str], known: Collection[str]) -> None:
        """Check the names of the categories.

        Raises:
            ValueError: If one is unknown or named twice, or there are fewer than two.
        """
        if not set(names) <= set(known) or len(set(names)) < max(2, len(names)):
            raise ValueError(
                f"task.{field}={list(names)} must be at least 2 different ones of {list(known)}"
            )


class SortingTask(Task):
    """Toys have to be put into the baskets of their categories.

    A subclass defines the categories: it adds the toys and the baskets, and draws the category of
    each toy for each episode.

    Attributes:
        items: All toys.
        baskets: One for each category.
        category: The category of each toy, an index of `baskets`.
    """

    senses: ClassVar[tuple[str, ...]] = ("vision",)
    body_cfg = WalkerCfg
    verbs = ("grab", "put_into")
    cfg: SortingCfg

    @classmethod
    @abstractmethod
    def categories_of(cls, cfg: Any) -> list[str]:
        """Return the names of the categories."""

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        baskets = len(cls.categories_of(cfg))
        toys, furniture, spacing = cfg.items * baskets, planned_furniture(playground), _spacing(cfg)
        check_connected(cls.__name__, playground, wide_rooms(playground.rooms, spacing.clear_m))
        check_placement(
            lambda rng: scattered_places(playground, furniture, 1 + toys + baskets, spacing, rng),
            f"{cls.__name__} with {toys} toys (task.items={cfg.items} for each of {baskets} "
            f"baskets) and task.apart_m={cfg.apart_m:g}",
            "fewer or smaller ones, or a larger playground, such as playground=house",
        )

    @abstractmethod
    def add_items(self) -> list[Item]:
        """Add the toys to the world."""

    @abstractmethod
    def add_baskets(self) -> list[Basket]:
        """Add the baskets to the world, one for each category."""

    @abstractmethod
    def draw_categories(self, rng: np.random.Generator) -> list[int]:
        """Give the toys their looks for an episode; return the category of each."""

    def build(self) -> None:
        self.walker = require_walker(self.players[0])
        self._furniture = furniture_of(self.world)
        self.items = self.add_items()
        self.baskets = self.add_baskets()
        self.category = [0] * len(self.items)
        self._counts = self._changes = (0, 0)

    def reset(self, rng: np.random.Generator) -> None:
        self.category = self.draw_categories(rng)
        things: list[Basket | Item] = [*self.baskets, *self.items]
        start, *floors = scattered_places(
            self.world.playground, self._furniture, 1 + len(things), _spacing(self.cfg), rng
        )
        for thing, floor in zip(things, floors, strict=True):
            thing.place(floor, rng.uniform(-math.pi, math.pi))
        place_player(self.players[0], start, rng.uniform(-math.pi, math.pi))
        self._counts = self._changes = (0, 0)

    def after_step(self, rng: np.random.Generator) -> None:
        right, wrong = self._count()
        self._changes = right - self._counts[0], wrong - self._counts[1]
        self._counts = right, wrong

    def reward(self, player: Player) -> dict[str, float]:
        return {"sorted": float(self._changes[0]), "wrong": float(self._changes[1])}

    def state(self) -> dict[str, float]:
        return {
            f"{item.prop.name}_is_{number}": float(category == number)
            for item, category in zip(self.items, self.category, strict=True)
            for number in range(len(self.baskets))
        }

    def terminated(self) -> bool:
        return self._counts[0] == len(self.items)

    def solved(self, player: Player) -> bool:
        """Return whether all toys are in their baskets."""
        return self._counts[0] == len(self.items)

    def is_sorted(self, number: int) -> bool:
        """Return whether the toy of a number is in its basket."""
        return self.baskets[self.category[number]].contains(self.items[number].prop)

    def _count(self) -> tuple[int, int]:
        """Return how many toys are in their baskets, and how many are in others."""
        right = wrong = 0
        for number, basket_number in self._near_pairs():
            if self.baskets[basket_number].contains(self.items[number].prop):
                right += basket_number == self.category[number]
                wrong += basket_number != self.category[number]
        return right, wrong

    def _near_pairs(self) -> list[tuple[int, int]]:
        """Return the numbers of the pairs of a toy and a basket that are near each other.

        All others are left out of the exact test, which takes longer than this one of all pairs.
        """
        toys = np.array([item.prop.position[:2] for item in self.items])
        middles = np.array([basket.prop.position[:2] for basket in self.baskets])
        offsets = toys[:, None] - middles
        near = np.hypot(offsets[..., 0], offsets[..., 1]) <= REACH_M
        return [(int(number), int(basket)) for number, basket in np.argwhere(near)]


def _spacing(cfg: SortingCfg) -> Spacing:
    return Spacing(REACH_M + _PASSAGE_M, cfg.apart_m, _DOOR_M)

"""A sense of warmth at the palms, and a task for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.extend import (
    ArraySpec,
    Body,
    Player,
    PropCfg,
    PropShape,
    Sense,
    Task,
    TaskCfg,
    World,
    register_sense,
    register_task,
    terms,
)

STOVE = "stove"


@dataclass
class WarmthCfg:
    """Settings of the sense of warmth.

    Attributes:
        present: Whether the palms feel warmth.
        range_m: Distance from the middle of the stove at which warmth has fallen to one half.
    """

    present: bool = True
    range_m: float = 0.5


@register_sense("warmth")
class Warmth(Sense):
    """Warmth at the palms, left first, ``(2,)`` in [0, 1]; 0 in a world without a stove."""

    cfg_type = WarmthCfg

    def __init__(self, cfg: WarmthCfg, body: Body, world: World) -> None:
        super().__init__(world)
        self.specs = {"warmth": ArraySpec((2,), np.float32, 0.0, 1.0)}
        self._body, self._world, self._range_m = body, world, cfg.range_m

    def compute(self) -> dict[str, np.ndarray]:
        stove = self._world.props.get(STOVE)
        if stove is None:
            return {"warmth": np.zeros(2, np.float32)}
        away_m = np.linalg.norm(self._body.palms() - stove.position, axis=1)
        return {"warmth": (1.0 / (1.0 + (away_m / self._range_m) ** 2)).astype(np.float32)}


@dataclass
class WarmHandsCfg(TaskCfg):
    """Numbers of WarmHands.

    Attributes:
        near_m: The hands are warm while a palm is within this distance of the stove's middle.
    """

    near_m: float = 0.6
    weights: dict[str, float] = terms(warm=1.0)


@register_task
class WarmHands(Task):
    """Find a stove by the warmth at the palms. Sparse on purpose, and without an expert.

    Terms:
        warm: 1 while a palm is near the stove, else 0.
    """

    senses = ("warmth", "proprioception")
    rates = ("warm",)
    cfg: WarmHandsCfg

    def build(self) -> None:
        self.room = self.world.playground.rooms[0]
        stove = PropCfg(STOVE, PropShape.cylinder, [0.15, 0.6], colour=(0.9, 0.4, 0.1))
        self.stove = self.world.add_prop(stove)

    def reset(self, rng: np.random.Generator) -> None:
        start = goal = self.room.sample_floor(rng, margin_m=1.0)
        while np.linalg.norm(goal - start) < 1.5:
            goal = self.room.sample_floor(rng, margin_m=1.0)
        self.stove.place(goal + np.array([0.0, 0.0, 0.3]))
        self.players[0].body.place(start, rng.uniform(-np.pi, np.pi))

    def reward(self, player: Player) -> dict[str, float]:
        away_m = np.linalg.norm(player.body.palms() - self.stove.position, axis=1)
        return {"warm": float(away_m.min() < self.cfg.near_m)}

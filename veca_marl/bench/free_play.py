"""A game without rules for any number of players: what many agents in one room cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.scoring import cosine, flat
from veca_marl.envs.task import TASKS, Player, Task, TaskCfg, Team, find_task, terms
from veca_marl.sim.props import PropCfg, PropShape
from veca_marl.sim.sounds import SoundCfg, SoundKind


@dataclass
class FreePlayCfg(TaskCfg):
    """Nothing but the one term."""

    weights: dict[str, float] = terms(approach=1.0)


class FreePlay(Task):
    """Players walk about in a room with one buzzing ball. Only for measuring.

    Terms:
        approach: cosine of the angle between the player's velocity and the way to the ball.
    """

    cfg: FreePlayCfg

    def build(self) -> None:
        """See `Task`."""
        self.room = self.world.playground.rooms[0]
        buzz = SoundCfg(kind=SoundKind.buzz, level=0.1)
        ball = PropCfg(name="ball", shape=PropShape.sphere, size_m=[0.15], mass_kg=0.3, sound=buzz)
        self.ball = self.world.add_prop(ball)

    def reset(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        for player in self.players:
            start = self.room.sample_floor(rng, margin_m=1.0)
            player.body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        self.ball.place(self.room.sample_floor(rng, margin_m=1.0) + np.array([0.0, 0.0, 0.15]))

    def reward(self, player: Player) -> dict[str, float]:
        """See `Task`."""
        way = flat(self.ball.position - player.body.position)
        return {"approach": cosine(player.body.velocity, way)}

    def expert(self, player: Player, observation: dict[str, NDArray[Any]]) -> tuple[float, float]:
        """Walk on."""
        return 1.0, 0.0


@contextmanager
def free_play(players: int, like: TaskCfg) -> Iterator[TaskCfg]:
    """Make a free-play task known for a while.

    Args:
        players: How many play.
        like: The task whose senses they have.
    """
    name = f"FreePlay{players}"
    members = {
        "teams": (Team("agents", players),),
        "senses": find_task(like.name).senses,
    }
    TASKS[name] = type(name, (FreePlay,), members)
    try:
        yield FreePlayCfg(name=name)
    finally:
        del TASKS[name]

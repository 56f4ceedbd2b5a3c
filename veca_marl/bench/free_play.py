"""A game without rules for any number of players: what many agents in one room cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import cosine, horizontal
from veca_marl.envs.core.task import TASKS, Player, Task, TaskCfg, Team, find_task, terms
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.sound.sounds import SoundCfg, SoundKind


@dataclass
class FreePlayCfg(TaskCfg):
    """How full the room is.

    Attributes:
        things: Loose balls and boxes beside the buzzing ball.
    """

    things: int = 0
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
        self.things = [self.world.add_prop(_thing(i)) for i in range(self.cfg.things)]

    def reset(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        for player in self.players:
            start = self.room.sample_floor(rng, margin_m=1.0)
            player.body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        for thing in [self.ball, *self.things]:
            thing.place(self.room.sample_floor(rng, margin_m=1.0) + np.array([0.0, 0.0, 0.15]))

    def reward(self, player: Player) -> dict[str, float]:
        """See `Task`."""
        way = horizontal(self.ball.position - player.body.position)
        return {"approach": cosine(player.body.velocity, way)}


def _thing(number: int) -> PropCfg:
    shape, size = (PropShape.sphere, [0.06]) if number % 2 else (PropShape.box, [0.1, 0.1, 0.1])
    return PropCfg(name=f"thing_{number}", shape=shape, size_m=size, mass_kg=0.2)


@contextmanager
def free_play(
    players: int, like: TaskCfg, senses: tuple[str, ...] | None = None, things: int = 0
) -> Iterator[TaskCfg]:
    """Make a free-play task known for a while.

    Args:
        players: How many play.
        like: The task whose senses they have, if nothing else is said.
        senses: Their senses.
        things: How many loose things lie about.
    """
    name = f"FreePlay{players}"
    members = {
        "teams": (Team("agents", players),),
        "senses": find_task(like.name).senses if senses is None else senses,
    }
    TASKS[name] = type(name, (FreePlay,), members)
    try:
        yield FreePlayCfg(name=name, things=things)
    finally:
        del TASKS[name]

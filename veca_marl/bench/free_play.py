"""A task without rules for any number of agents: the cost of many bodies in one room."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS, Player, Task, TaskCfg, Team, find_task, terms
from veca_marl.sim.physics import PropCfg, PropShape
from veca_marl.sim.sound import SoundCfg, SoundKind

_BALL_RADIUS_M = 0.15


@dataclass
class FreePlayCfg(TaskCfg):
    """Parameters of free play.

    Attributes:
        loose_props: Loose balls and boxes beside the buzzing ball.
    """

    loose_props: int = 0
    weights: dict[str, float] = terms(speed=1.0)


class FreePlay(Task):
    """Agents move about in a room with one buzzing ball and loose props. Used for measuring only.

    Terms:
        speed: horizontal speed of the agent (m/s).
    """

    cfg: FreePlayCfg

    def build(self) -> None:
        """See `Task`."""
        self.room = self.world.playground.rooms[0]
        buzz = SoundCfg(kind=SoundKind.buzz, level=0.1)
        ball = PropCfg("ball", PropShape.sphere, [_BALL_RADIUS_M], mass_kg=0.3, sound=buzz)
        cfgs = [ball, *(_loose_prop(number) for number in range(self.cfg.loose_props))]
        self.loose = [self.world.add_prop(cfg) for cfg in cfgs]

    def reset(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        for player in self.players:
            start = self.room.sample_floor(rng, margin_m=1.0)
            player.body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        for prop in self.loose:
            height = np.array([0.0, 0.0, _BALL_RADIUS_M])
            prop.place(self.room.sample_floor(rng, margin_m=1.0) + height)

    def reward(self, player: Player) -> dict[str, float]:
        """See `Task`."""
        velocity = player.body.velocity
        return {"speed": math.hypot(velocity[0], velocity[1])}


def _loose_prop(number: int) -> PropCfg:
    shape, size = (PropShape.sphere, [0.06]) if number % 2 else (PropShape.box, [0.1, 0.1, 0.1])
    return PropCfg(name=f"loose_{number}", shape=shape, size_m=size, mass_kg=0.2)


@contextmanager
def free_play(
    game: GameCfg, agents: int, loose_props: int = 0, senses: Sequence[str] | None = None
) -> Iterator[GameCfg]:
    """Register free play for the duration of a with statement.

    Args:
        game: The playground, the body, the quality of the senses and the clock.
        agents: Number of agents, all in one team.
        loose_props: Number of loose props on the floor.
        senses: Names of the senses; None takes those of the task of `game`.

    Yields:
        The configuration of a game of free play.
    """
    name = f"FreePlay{agents}"
    members = {
        "teams": (Team("agents", agents),),
        "senses": find_task(game.task.name).senses if senses is None else tuple(senses),
    }
    TASKS[name] = type(name, (FreePlay,), members)
    task = FreePlayCfg(name=name, loose_props=loose_props)
    try:
        yield replace(game, task=task, team={}, script={})
    finally:
        del TASKS[name]

"""MultiAgentNav: who finds the object calls the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from veca_marl.envs.tasks.multi_agent.floor_plan import FloorPlan

from veca_marl.envs.core.task import Player, Task, TaskCfg, Team, register, terms
from veca_marl.envs.tasks.multi_agent.contests import line_up, look_ahead
from veca_marl.envs.tasks.multi_agent.navigation import Sight, free_pair, free_place, gap_m, way_to
from veca_marl.sim.physics import PropCfg, PropShape

_PASS_M = 0.2  # who stands at the object leaves so much between itself and the wall


class Muted(Enum):
    """Whose voice is not heard: to ask what hearing is worth."""

    nobody = "nobody"
    finder = "finder"
    everybody = "everybody"


@dataclass
class MultiAgentNavCfg(TaskCfg):
    """How many seek what, and what finding it is worth.

    Attributes:
        agents: How many seek, at least 2; the playground needs a room for each.
        radius_m: Radius of the object, a ball too heavy to be moved.
        reach_m: Who comes so near to its surface has reached it.
        muted: Whose calls nobody hears; the finder is who starts in the object's room.
    """

    agents: int = 2
    radius_m: float = 0.2
    reach_m: float = 0.4
    muted: Muted = Muted.nobody
    weights: dict[str, float] = terms(reached=1.0, ahead=0.05, aside=0.03)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.agents < 2:
            raise ValueError(f"task.agents={self.agents} must be at least 2")
        if not isinstance(self.muted, Muted):
            choices = [choice.name for choice in Muted]
            raise ValueError(f"task.muted={self.muted!r}; there are {choices}")
        self._check_positive("radius_m", "reach_m")


@register
class MultiAgentNav(Task):
    """Agents start in rooms of their own, the object lies in one of these; all must come to it.

    Nobody sees through walls, so that the one who finds the object should call: in the next room
    the call is heard from where it comes from, through a door as it is, through a wall 30 dB
    weaker. Each agent that reaches the object for the first time earns 1 for everybody; when the
    last one has, the game is over. The paper gives the rooms, the shared reward and the helper
    reward; sizes and times are ours.

    The paper's table of tasks lists vision, touch and proprioception, but its text has the others
    come "using auditory perception": here they have ears as well.

    `playground=seven_rooms`, its own, takes up to 7 agents: the ways are short, but who is not
    called has much to search. `two_rooms`, `three_rooms` and `four_rooms` are for so many.
    Joint-level bodies start on hands and knees and look ahead as far as their eyes turn; with
    `body=mitten_voice` or `full_voice` they can call. They need more time: a scripted crawl solves
    nearly every game within `task.max_seconds=90`.

    Terms:
        reached: how many agents reached the object for the first time in this step, the same for
            all. "All agents receive +1 reward when each agent navigates to the object" is read as
            +1 for each of them, so that n agents earn n.
        ahead: metres covered forward in this step (backward is negative) while the object is
            visible to the left eye and until it is reached; the paper's Vis a_f.
        aside: metres covered to the side the object is on, likewise; the paper's Vis a_l L.
    """

    senses = ("vision", "touch", "proprioception", "audio")
    cfg: MultiAgentNavCfg

    @classmethod
    def teams_of(cls, cfg: Any) -> tuple[Team, ...]:
        return (Team("seekers", cfg.agents),)

    def build(self) -> None:
        playground = self.world.playground
        rooms = len(playground.rooms)
        if len(self.players) > rooms:
            raise ValueError(
                f"task.agents={len(self.players)} start in rooms of their own, but playground "
                f"{playground.name!r} has {rooms}; choose task.agents of at most {rooms}, or "
                "playground=two_rooms, three_rooms, four_rooms, seven_rooms"
            )
        self.plan = FloorPlan(playground)
        self._furniture = [
            prop for prop in self.world.props.values() if prop.cfg.shape is not PropShape.wall
        ]
        self.target = self.world.add_prop(
            PropCfg(
                name="target",
                shape=PropShape.sphere,
                size_m=[self.cfg.radius_m],
                colour=(0.95, 0.15, 0.1),
            )
        )
        self._sight = Sight(self.world.scene, self.target)
        self.arrived: set[str] = set()
        self._new = 0

    def reset(self, rng: np.random.Generator) -> None:
        for memory in (self._sight, self.arrived):
            memory.clear()
        self._new = 0
        order = rng.permutation(len(self.plan.rooms))[: len(self.players)]
        rooms = [self.plan.rooms[index] for index in order]
        home = rooms[rng.integers(len(rooms))]
        clear_m = self.cfg.radius_m + self.cfg.reach_m + _PASS_M
        apart_m = self.cfg.radius_m + clear_m
        (x, y, floor_m), beside = free_pair(home, self._furniture, clear_m, apart_m, rng)
        self.target.place((x, y, floor_m + self.cfg.radius_m))
        for room, player in zip(rooms, self.players, strict=True):
            place = beside if room is home else free_place(room, self._furniture, clear_m, rng)
            line_up(player, place, rng.uniform(-math.pi, math.pi))
            if self.cfg.muted is not Muted.nobody:
                player.body.muted = room is home or self.cfg.muted is Muted.everybody
        look_ahead(self.players)

    def after_step(self, rng: np.random.Generator) -> None:
        look_ahead(self.players)
        before = len(self.arrived)
        for player in self.players:
            if gap_m(player.body.position, self.target) <= self.cfg.reach_m:
                self.arrived.add(player.name)
        self._new = len(self.arrived) - before

    def reward(self, player: Player) -> dict[str, float]:
        ahead = aside = 0.0
        if player.name not in self.arrived and self.sees_target(player):
            ahead, aside = way_to(player.body, self.target.position, self.world.clock.step_s)
        return {"reached": float(self._new), "ahead": ahead, "aside": aside}

    def sees_target(self, player: Player) -> bool:
        """Return whether the object is visible to the left eye of a player."""
        return self._sight.of(player)

    def terminated(self) -> bool:
        return len(self.arrived) == len(self.players)

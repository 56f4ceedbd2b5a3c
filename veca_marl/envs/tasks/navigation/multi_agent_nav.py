"""MultiAgentNav: search for an object in a house and call the other agents to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, Team, register_task, terms
from veca_marl.envs.tasks.floors.floor_plan import FloorPlan
from veca_marl.envs.tasks.floors.outlines import check_reach
from veca_marl.envs.tasks.floors.places import (
    add_target,
    direct_gaze_ahead,
    free_pair,
    free_place,
    furniture_of,
    gap_m,
    place_player,
    planned_furniture,
    planned_target,
    rooms_with_pairs,
)
from veca_marl.envs.tasks.floors.playability import (
    check_connected,
    check_doorways,
    check_placement,
    check_rooms,
)
from veca_marl.envs.tasks.navigation.helper_reward import (
    AHEAD_WEIGHT,
    TURN_WEIGHT,
    HelperReward,
)
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.physics import PlaygroundCfg, RoomCfg, StandingProp

_PASSAGE_M = 0.2  # width that an agent at the object leaves free towards the walls


class Muted(Enum):
    """Agents without a voice, for measuring what hearing contributes.

    Attributes:
        none: All agents have a voice.
        finder: The agent that starts in the room of the object has none.
        seekers: The agents that start in other rooms have none.
        all: No agent has a voice.
    """

    none = "none"
    finder = "finder"
    seekers = "seekers"
    all = "all"


@dataclass
class MultiAgentNavCfg(TaskCfg):
    """Parameters of MultiAgentNav.

    Attributes:
        agents: Number of agents, at least 2; the playground needs a room for each.
        radius_m: Radius of the object, a fixed ball.
        reach_m: Distance from the surface of the object within which an agent has reached it.
        muted: Agents without a voice, see `Muted`.
        separate_finder: Whether the agent that starts in the room of the object is a team of its
            own, `finder`, before the team `seekers` of the others.
    """

    agents: int = 2
    radius_m: float = 0.2
    reach_m: float = 0.4
    muted: Muted = Muted.none
    separate_finder: bool = False
    weights: dict[str, float] = terms(reached=1.0, ahead=AHEAD_WEIGHT, turn=TURN_WEIGHT)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.agents < 2:
            raise ValueError(f"task.agents={self.agents} must be at least 2")
        if not isinstance(self.muted, Muted):
            choices = [choice.name for choice in Muted]
            raise ValueError(f"task.muted={self.muted!r}; choices: {choices}")
        self.check_positive("radius_m", "reach_m")


@register_task
class MultiAgentNav(Task):
    """Agents start in separate rooms, one of which contains an object that all have to reach.

    An agent sees the object only from its room or through a door, so the agent that finds it
    should call the others. With `separate_finder` the agent that starts in the room of the object
    is a team of its own, which can have another policy. A call is heard from its direction in the
    next room; a wall attenuates it by 30 dB. The episode terminates when all agents have reached
    the object; then the task is solved (`solved`) for all of them.

    The rooms, the shared reward and the helper reward are those of the paper (table of tasks and
    "Helper Rewards" in the appendix; "Multi-Agent Reinforcement Learning"); sizes and times are
    not in the paper. Departures: the paper's table lists vision, touch and proprioception, but its
    text has agents come "using auditory perception", so hearing is included here; the paper
    distributes agents in each room, while by default five of the seven rooms are empty; `ahead` is
    in metres per step, and `turn` stands for the sideways velocity that walking bodies do not have,
    see `HelperReward`.

    The default `playground=seven_rooms` serves up to 7 agents; `two_rooms`, `three_rooms` and
    `four_rooms` serve as many as their names say. Joint-level bodies start on hands and knees with
    the eyes turned ahead; with `body=mitten_voice` (fixed fingers) or `full_voice` they can call.
    They need more time: the scripted expert solves nearly every game with `task.max_seconds=90`.

    Terms:
        reached: Number of agents that reached the object for the first time in this step, equal
            for all agents. The paper's "all agents receive +1 reward when each agent navigates to
            the object" is read as +1 for each agent that arrives.
        ahead: Displacement forwards during the step, m (negative backwards), while the object is
            visible to the agent's eyes and the agent has not reached it. In the paper ``Vis a_f``.
            Its sum has no bound: walking in a circle near the object is paid too.
        turn: Decrease of the horizontal angle between the agent's forward direction and the
            direction of the object since the object was last visible, rad, under the same
            conditions. In the paper ``Vis a_l L``.
    """

    senses = ("vision", "touch", "proprioception", "audio")
    cfg: MultiAgentNavCfg

    @classmethod
    def teams_of(cls, cfg: Any) -> tuple[Team, ...]:
        if cfg.separate_finder:
            return (Team("finder"), Team("seekers", cfg.agents - 1))
        return (Team("seekers", cfg.agents),)

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_rooms(playground, cfg.agents)
        check_connected(cls.__name__, playground, playground.rooms)
        find_homes = cache(lambda: rooms_with_pairs(playground, *_distances_m(cfg)))
        furniture = planned_furniture(playground)
        check_placement(
            lambda rng: _try_start(cfg, find_homes(), playground.rooms, furniture, rng),
            f"playground {playground.name!r}, task.radius_m={cfg.radius_m:g}, "
            f"task.reach_m={cfg.reach_m:g}",
            "smaller ones, or larger rooms, such as playground=seven_rooms",
        )

    @classmethod
    def check_distances(
        cls, cfg: Any, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
    ) -> None:
        check_reach(cfg.reach_m, planned_target(cfg.radius_m), bodies)

    def build(self) -> None:
        check_doorways(self.world.playground, self.players)
        self.plan = FloorPlan(self.world.playground)
        self._furniture = furniture_of(self.world)
        self._homes = rooms_with_pairs(self.world.playground, *_distances_m(self.cfg))
        self.target = add_target(self.world, self.cfg.radius_m)
        self._helper = HelperReward(self.world.scene)
        self.arrived: set[str] = set()
        self._newly_arrived = 0

    def reset(self, rng: np.random.Generator) -> None:
        self.arrived.clear()
        self._newly_arrived = 0
        rooms, home = self._draw_rooms(rng)
        clear_m, apart_m = _distances_m(self.cfg)
        (x, y, floor_m), beside = free_pair(home, self._furniture, clear_m, apart_m, rng)
        self.target.place((x, y, floor_m + self.cfg.radius_m))
        for room, player in zip(rooms, self.players, strict=True):
            free = beside
            if room is not home:
                free = free_place(room, self._furniture, clear_m, rng)
            place_player(player, free, rng.uniform(-math.pi, math.pi))
            if self.cfg.muted is not Muted.none:
                silent = (Muted.all, Muted.finder if room is home else Muted.seekers)
                player.body.muted = self.cfg.muted in silent
        direct_gaze_ahead(self.players)
        self._helper.reset(self.target, self.players)

    def _draw_rooms(self, rng: np.random.Generator) -> tuple[list[RoomCfg], RoomCfg]:
        """Draw a room for each agent, and of these the room of the object, which must fit in."""
        while True:
            order = rng.permutation(len(self.plan.rooms))[: len(self.players)]
            rooms = [self.plan.rooms[index] for index in order]
            home = rooms[0 if self.cfg.separate_finder else rng.integers(len(rooms))]
            if home in self._homes:
                return rooms, home

    def before_step(self, rng: np.random.Generator) -> None:
        self._helper.before_step(self.players)

    def after_step(self, rng: np.random.Generator) -> None:
        direct_gaze_ahead(self.players)
        before = len(self.arrived)
        for player in self.players:
            if gap_m(player.body.position, self.target) <= self.cfg.reach_m:
                self.arrived.add(player.name)
        self._newly_arrived = len(self.arrived) - before
        self._helper.after_step([p for p in self.players if p.name not in self.arrived])

    def state(self) -> dict[str, float]:
        return {f"{p.name}_arrived": float(p.name in self.arrived) for p in self.players}

    def reward(self, player: Player) -> dict[str, float]:
        return {"reached": float(self._newly_arrived), **self._helper.terms(player)}

    def terminated(self) -> bool:
        return len(self.arrived) == len(self.players)

    def solved(self, player: Player) -> bool:
        """Return whether all agents have reached the object."""
        return self.terminated()

    def sees_target(self, player: Player) -> bool:
        """Return whether the object is visible to an eye of a player."""
        return self._helper.sees(self.target, player)


def _distances_m(cfg: MultiAgentNavCfg) -> tuple[float, float]:
    """Return the least distances of the places from walls and things, and from each other."""
    clear_m = cfg.radius_m + cfg.reach_m + _PASSAGE_M
    return clear_m, cfg.radius_m + clear_m


def _try_start(
    cfg: MultiAgentNavCfg,
    homes: Sequence[RoomCfg],
    rooms: Sequence[RoomCfg],
    furniture: Sequence[StandingProp],
    rng: np.random.Generator,
) -> None:
    """Look for places of the object and an agent in a home, and of an agent in each room."""
    clear_m, apart_m = _distances_m(cfg)
    home = homes[int(rng.integers(len(homes)))]
    free_pair(home, furniture, clear_m, apart_m, rng)
    for room in rooms:
        free_place(room, furniture, clear_m, rng)

"""MultiAgentNav: who finds the object calls the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.experts.seeking import Seeker, Wish
from veca_marl.envs.navigation import FloorPlan, gap_m, way_to
from veca_marl.envs.task import Player, Task, TaskCfg, Team, register, terms, walker
from veca_marl.sim.playground import RoomCfg
from veca_marl.sim.pose import Floats
from veca_marl.sim.props import Prop, PropCfg, PropShape

_PASS_M = 0.2  # who stands at the object leaves so much between itself and the wall
_TRIES = 1000


@dataclass
class MultiAgentNavCfg(TaskCfg):
    """How many seek what, and what finding it is worth.

    Attributes:
        agents: How many seek, at least 2; the playground needs a room for each.
        radius_m: Radius of the object, a ball too heavy to be moved.
        reach_m: Who comes so near to its surface has reached it.
    """

    agents: int = 2
    radius_m: float = 0.2
    reach_m: float = 0.4
    weights: dict[str, float] = terms(reached=1.0, ahead=0.05, aside=0.03)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.agents < 2:
            raise ValueError(f"task.agents={self.agents} must be at least 2")
        for name in ("radius_m", "reach_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"task.{name}={value} must be a positive number")


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

    `task.agents` of 2 to 4 find rooms in `playground=four_rooms`; `two_rooms` and `three_rooms` are
    for so many. Bodies without a vocabulary of calls play too: joint-level ones call
    by `make_sound`, which is not part of their action row.

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
                "playground=two_rooms, three_rooms, four_rooms"
            )
        self.plan = FloorPlan(playground)
        self.target = self.world.add_prop(
            PropCfg(
                name="target",
                shape=PropShape.sphere,
                size_m=[self.cfg.radius_m],
                colour=(0.95, 0.15, 0.1),
            )
        )
        self._furniture = [
            prop
            for prop in self.world.props.values()
            if prop.cfg.shape is not PropShape.wall and prop is not self.target
        ]
        self._seekers: dict[str, Seeker] = {}
        self._sights: dict[str, tuple[int, bool]] = {}
        self._clear()

    def _clear(self) -> None:
        self._seekers.clear()
        self._sights.clear()
        self.arrived: set[str] = set()
        self._new = 0

    def reset(self, rng: np.random.Generator) -> None:
        self._clear()
        rooms = [self.plan.rooms[i] for i in rng.permutation(len(self.plan.rooms))]
        rooms = rooms[: len(self.players)]
        place = self._free_place(rooms[rng.integers(len(rooms))], self._furniture, rng)
        self.target.place((place[0], place[1], place[2] + self.cfg.radius_m))
        for room, player in zip(rooms, self.players, strict=True):
            place = self._free_place(room, [*self._furniture, self.target], rng)
            player.body.place(place, yaw_rad=rng.uniform(-math.pi, math.pi))

    def after_step(self, rng: np.random.Generator) -> None:
        before = len(self.arrived)
        for player in self.players:
            if gap_m(player.body.position, self.target) <= self.cfg.reach_m:
                self.arrived.add(player.name)
        self._new = len(self.arrived) - before

    def reward(self, player: Player) -> dict[str, float]:
        ahead = aside = 0.0
        if player.name not in self.arrived and self.sees(player):
            ahead, aside = way_to(player.body, self.target.position, self.world.clock.step_s)
        return {"reached": float(self._new), "ahead": ahead, "aside": aside}

    def terminated(self) -> bool:
        return len(self.arrived) == len(self.players)

    def sees(self, player: Player) -> bool:
        """Say whether the object is visible to a player's left eye now."""
        version = self.world.scene.version
        known, seen = self._sights.get(player.name, (-1, False))
        if known != version:
            seen = player.body.is_visible(self.target)
            self._sights[player.name] = version, seen
        return seen

    def expert(self, player: Player, observation: dict[str, NDArray[Any]]) -> Wish:
        """Look round, go and call; else listen, and go where a call comes from.

        It needs a body that walks. Who has seen the object (`is_visible`) knows its place, goes
        there and calls while in its room. Who has not turns to the louder ear and, when both hear
        the same, takes the loudness for the distance: what a caller is worth to it, it has from
        the observation `audio` alone. Who hears nothing turns round once in each room, the nearest
        first. Privileged: an agent's own place and heading, and the plan of the house.
        """
        seeker = self._seekers.get(player.name)
        if seeker is None:
            seeker = Seeker(walker(player), self.plan, self.world)
            self._seekers[player.name] = seeker
        seen = self.target.position if self.sees(player) else None
        return seeker.wish(observation.get("audio"), seen)

    def _free_place(self, room: RoomCfg, things: list[Prop], rng: np.random.Generator) -> Floats:
        """Draw a place of a room's floor, clear of walls and things."""
        clear_m = self.cfg.radius_m + self.cfg.reach_m + _PASS_M
        for _ in range(_TRIES):
            place = room.sample_floor(rng, clear_m)
            if all(gap_m(place, thing) >= clear_m for thing in things):
                return place
        raise ValueError(f"room {room.name!r} leaves no floor {clear_m} m away from everything")

"""FindBeacon: walk to a loudspeaker that stands somewhere in the room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.extend import (
    Player,
    PropCfg,
    PropShape,
    SoundCfg,
    SoundKind,
    Task,
    TaskCfg,
    register_task,
    terms,
)


@dataclass
class FindBeaconCfg(TaskCfg):
    """Parameters of FindBeacon.

    Attributes:
        reach_m: Horizontal distance from the beacon at which the episode ends with success.
    """

    reach_m: float = 0.6
    weights: dict[str, float] = terms(reached=1.0, progress=0.1)


@register_task
class FindBeacon(Task):
    """Walk to a buzzing cylinder; the episode ends when it is reached.

    Terms:
        reached: 1 on the step on which the agent comes within `reach_m` of the beacon.
        progress: decrease of the horizontal distance to the beacon in this step (m).
    """

    senses = ("vision", "audio")
    cfg: FindBeaconCfg

    def build(self) -> None:
        """See `Task`."""
        buzz = SoundCfg(kind=SoundKind.buzz, level=0.1)
        shape = PropCfg("beacon", PropShape.cylinder, [0.1, 0.6], mass_kg=2.0, sound=buzz)
        shape.interactions = ["switch_off"]
        self.beacon = self.world.add_prop(shape)
        self.distance_m = self.progress_m = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        room = self.world.playground.rooms[0]
        self.beacon.place(room.sample_floor(rng, margin_m=0.5) + np.array([0.0, 0.0, 0.3]))
        start = room.sample_floor(rng, margin_m=1.0)
        self.players[0].body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        self.distance_m = self._distance()

    def after_step(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        self.progress_m = self.distance_m - self._distance()
        self.distance_m -= self.progress_m

    def reward(self, player: Player) -> dict[str, float]:
        """See `Task`."""
        return {"reached": float(self.terminated()), "progress": self.progress_m}

    def terminated(self) -> bool:
        """See `Task`."""
        return self.distance_m < self.cfg.reach_m

    def _distance(self) -> float:
        way = self.beacon.position - self.players[0].body.position
        return math.hypot(way[0], way[1])

"""LeadByVoice: one agent hears a hidden beeper and leads another one by voice."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.extend import (
    Call,
    ClockCfg,
    Expert,
    Player,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    SoundCfg,
    SoundKind,
    Task,
    TaskCfg,
    Team,
    WalkCommand,
    WalkerCfg,
    register_expert,
    register_task,
    terms,
)


@dataclass
class LeadByVoiceCfg(TaskCfg):
    """Numbers of LeadByVoice.

    Attributes:
        reach_m: The follower has found the beeper within this horizontal distance.
        pulse_s: Duration of a beep.
        pause_s: Silence between beeps.
    """

    reach_m: float = 0.6
    pulse_s: float = 0.2
    pause_s: float = 0.4
    weights: dict[str, float] = terms(progress=0.1, found=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("reach_m", "pulse_s", "pause_s")


@register_task
class LeadByVoice(Task):
    """A follower has to find a beeper that only its leader hears; both share the reward.

    Neither sees. The leader starts nearer to the beeper; the follower hears its calls.

    Terms:
        progress: Decrease of the follower's distance from the beeper in this step, m.
        found: 1 on the step in which the follower reaches the beeper; the episode ends.
    """

    teams = (Team("leader"), Team("follower"))
    senses = ("audio",)
    body_cfg = WalkerCfg
    needs_voice = True
    cfg: LeadByVoiceCfg

    @classmethod
    def check_playground(cls, cfg: LeadByVoiceCfg, playground: PlaygroundCfg) -> None:
        sizes = [min(room.size_m[:2]) for room in playground.rooms]
        if not sizes or sizes[0] < 4.0:
            raise ValueError(
                f"playground {playground.name!r}: LeadByVoice needs a first room of at least 4 m, "
                "such as playground=single_room"
            )

    @classmethod
    def check_clock(cls, cfg: LeadByVoiceCfg, clock: ClockCfg) -> None:
        if cfg.pulse_s < clock.step_s:
            raise ValueError(f"task.pulse_s={cfg.pulse_s} must be at least a step, {clock.step_s}")

    def build(self) -> None:
        self.leader, self.follower = self.players
        self.room = self.world.playground.rooms[0]
        beep = SoundCfg(
            SoundKind.tone,
            frequency_hz=880.0,
            level=0.1,
            pulse_s=self.cfg.pulse_s,
            pause_s=self.cfg.pause_s,
        )
        disc = PropCfg("beeper", PropShape.cylinder, [0.05, 0.01], tangible=False, sound=beep)
        self.beeper = self.world.add_prop(disc)
        self.follower.body.deaf_to.add("beeper")

    def reset(self, rng: np.random.Generator) -> None:
        far = 0.0
        while far < 2.0:
            goal, start, other = (self.room.sample_floor(rng, margin_m=1.2) for _ in range(3))
            far = min(math.dist(goal, other), math.dist(start, other))
        self.beeper.place(goal + np.array([0.0, 0.0, 0.01]))
        self.leader.body.place(start, rng.uniform(-math.pi, math.pi))
        self.follower.body.place(other, rng.uniform(-math.pi, math.pi))
        self.last_m = self.distance_m = self.away_m(self.follower)

    def after_step(self, rng: np.random.Generator) -> None:
        self.last_m, self.distance_m = self.distance_m, self.away_m(self.follower)

    def reward(self, player: Player) -> dict[str, float]:
        return {"progress": self.last_m - self.distance_m, "found": float(self.terminated())}

    def terminated(self) -> bool:
        return self.distance_m < self.cfg.reach_m

    def solved(self, player: Player) -> bool:
        return self.terminated()

    def away_m(self, player: Player) -> float:
        """Return the horizontal distance of a player from the beeper."""
        return float(np.linalg.norm((self.beeper.position - player.body.position)[:2]))


@register_expert("LeadByVoice")
class LeadByVoiceExpert(Expert[LeadByVoice]):
    """The leader walks to the beeper (privileged: its position) and calls; the follower listens."""

    reads = needs = ("audio",)

    def act(self, observation):
        if self.player.team == "follower":
            return self.walk_to_the_louder_ear(observation["audio"])
        body = self.player.body
        way = (self.task.beeper.position - body.position)[:2]
        away_m = np.linalg.norm(way)
        left = np.array([-body.forward[1], body.forward[0]])
        turn = float(np.clip(3.0 * (way / max(away_m, 0.1)) @ left, -1.0, 1.0))
        if away_m < 0.15:
            return WalkCommand(0.0, 0.0, Call.low)
        return WalkCommand(1.0 if way @ body.forward[:2] > 0.0 else 0.0, turn, Call.low)

    def walk_to_the_louder_ear(self, audio):
        left, right = audio.mean(axis=-1)
        turn = float(np.clip((left - right) / 0.05, -1.0, 1.0))
        return WalkCommand(1.0 - abs(turn) / 2.0, turn)

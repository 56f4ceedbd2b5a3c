"""KickTheBall: hear where the ball comes from, go there, kick it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import cosine, horizontal, norm
from veca_marl.envs.core.task import Player, Task, TaskCfg, register, require_walker, terms
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.sound.sounds import SoundCfg, SoundKind


@dataclass
class KickTheBallCfg(TaskCfg):
    """How the ball comes, and what the paper's two reward terms are worth.

    Attributes:
        radius_m: Radius of the ball.
        mass_kg: Mass of the ball.
        speed_mps: Least and greatest speed at which it rolls out of the wall.
        spread_deg: It rolls into the room within so many degrees of straight ahead.
        life_s: A ball that nobody kicked is replaced after so long.
        rest_s: A kicked ball is replaced after so long.
        loudness: Level of its buzz, see `SoundCfg`.
        walking_mps: Who is slower than this stands, and approaches nothing.
    """

    radius_m: float = 0.15
    mass_kg: float = 0.3
    speed_mps: tuple[float, float] = (0.5, 1.0)
    spread_deg: float = 30.0
    life_s: float = 6.0
    rest_s: float = 0.4
    loudness: float = 0.1
    walking_mps: float = 0.35
    weights: dict[str, float] = terms(kick=1.0, approach=0.01)

    def __post_init__(self) -> None:
        super().__post_init__()
        slow, fast = self.speed_mps
        if not 0.0 < slow <= fast < math.inf:
            raise ValueError(f"task.speed_mps={self.speed_mps} must be (least, greatest), above 0")
        for name in ("life_s", "rest_s"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"task.{name}={getattr(self, name)} must be positive")


@register
class KickTheBall(Task):
    """A buzzing ball keeps rolling out of a side wall; hear where it is, reach it, kick it.

    The field of view is narrow (60 degrees), so hearing tells where to turn. A ball within reach of
    the foot (`Walker.can_kick`) is kicked by itself; it counts once, flies off, and 0.4 s later the
    next one comes out of the left (+y) or the right (-y) wall. A ball that nobody kicked is
    replaced after 6 s. An episode lasts 20 s and never ends early. The paper gives the sound, the
    walls and the helper reward (appendix "KickTheBall"); the numbers are ours.

    Terms:
        kick: 1 on the step the ball is kicked.
        approach: cosine of the angle between the player's velocity and the way to the ball; 0 while
            it stands. Without a least speed the term is best earned by creeping up to the ball
            backward, for ever and without a kick: one of three policies learnt that.
    """

    senses = ("vision", "audio")
    cfg: KickTheBallCfg

    def build(self) -> None:
        buzz = SoundCfg(kind=SoundKind.buzz, level=self.cfg.loudness)
        self.kicker = require_walker(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._kicked = self._scored = False
        self._left_s = 0.0
        self.ball = self.world.add_prop(
            PropCfg(
                name="ball",
                shape=PropShape.sphere,
                size_m=[self.cfg.radius_m],
                mass_kg=self.cfg.mass_kg,
                colour=(0.95, 0.15, 0.1),
                sound=buzz,
            )
        )

    def reset(self, rng: np.random.Generator) -> None:
        start = self.room.sample_floor(rng, margin_m=1.5)
        self.players[0].body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        self._launch(rng)

    def before_step(self, rng: np.random.Generator) -> None:
        self._left_s -= self.world.clock.step_s
        if self._left_s <= 0.0:
            self._launch(rng)

    def after_step(self, rng: np.random.Generator) -> None:
        self._scored = not self._kicked and self.kicker.kick(self.ball)
        if self._scored:
            self._kicked, self._left_s = True, self.cfg.rest_s

    def reward(self, player: Player) -> dict[str, float]:
        way, velocity = horizontal(self.ball.position - player.body.position), player.body.velocity
        walks = norm(velocity) >= self.cfg.walking_mps
        approach = cosine(velocity, way) if walks else 0.0
        return {"kick": float(self._scored), "approach": approach}

    def _launch(self, rng: np.random.Generator) -> None:
        """Let a new ball roll out of a side wall."""
        gap = self.cfg.radius_m + 0.02
        side = rng.choice((-1.0, 1.0))
        start = self.room.sample_floor(rng, margin_m=1.0)
        half = self.room.size_m[1] / 2
        start[1] = self.room.lower_m[1] + half + side * (half - gap)
        start[2] = self.cfg.radius_m
        heading = math.radians(rng.uniform(-self.cfg.spread_deg, self.cfg.spread_deg))
        way = np.array([math.sin(heading), -side * math.cos(heading), 0.0])
        speed = rng.uniform(*self.cfg.speed_mps)
        spin = np.cross((0.0, 0.0, 1.0), way) * speed / self.cfg.radius_m
        self.ball.place(start, velocity=speed * way, angular_velocity=spin)
        self._kicked = self._scored = False
        self._left_s = self.cfg.life_s

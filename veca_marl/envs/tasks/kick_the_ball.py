"""KickTheBall: locate a ball by its sound, walk to it and kick it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import (
    Player,
    Task,
    TaskCfg,
    cosine,
    horizontal,
    norm,
    register_task,
    require_walker,
    terms,
)
from veca_marl.envs.tasks.floors.playability import check_kickable
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.physics import (
    ClockCfg,
    PlaygroundCfg,
    Prop,
    PropCfg,
    PropShape,
    RoomCfg,
    penetration_m,
)
from veca_marl.sim.sound import SoundCfg, SoundKind

_WALL_GAP_M = 0.02  # between the ball and the wall
_END_CLEARANCE_M = 1.0  # from the walls at both ends of the side wall


def check_ball_speed(speed_mps: float, radius_m: float, clock: ClockCfg) -> None:
    """Check that a ball moves by at most its radius in one physics step.

    Contacts are found after each physics step: a faster ball could pass through a wall.

    Raises:
        ValueError: If it is faster; the message names the limit.
    """
    limit = radius_m / clock.substep_s
    if speed_mps > limit:
        raise ValueError(
            f"task.speed_mps of up to {speed_mps:g} covers more than task.radius_m={radius_m:g} in "
            f"a physics step of {clock.substep_s:.4g} s: at most {limit:.4g} m/s, or raise "
            "clock.substeps"
        )


def launch_from_side_wall(
    ball: Prop,
    room: RoomCfg,
    speed_mps: tuple[float, float],
    spread_deg: float,
    rng: np.random.Generator,
) -> None:
    """Place a ball at the left (+y) or right (-y) wall of a room, rolling into the room.

    Args:
        ball: A sphere.
        room: The room.
        speed_mps: Least and greatest speed.
        spread_deg: Largest angle between its direction and the wall's normal.
        rng: Random generator of the episode.
    """
    radius_m = ball.cfg.size_m[0]
    side = rng.choice((-1.0, 1.0))
    start = room.sample_floor(rng, margin_m=_END_CLEARANCE_M)
    half = room.size_m[1] / 2
    start[1] = room.lower_m[1] + half + side * (half - (radius_m + _WALL_GAP_M))
    start[2] = radius_m
    angle = math.radians(rng.uniform(-spread_deg, spread_deg))
    direction = np.array([math.sin(angle), -side * math.cos(angle), 0.0])
    speed = rng.uniform(*speed_mps)
    spin = np.cross((0.0, 0.0, 1.0), direction) * speed / radius_m
    ball.place(start, velocity=speed * direction, angular_velocity=spin)


_START_CLEARANCE_M = 1.5  # from the walls
_MOST_DRAWS = 50
_LARGEST_RADIUS_M = 0.6  # a ball at the wall is then 0.28 m or more from the middle of the player


@dataclass
class KickTheBallCfg(TaskCfg):
    """Parameters of KickTheBall.

    Attributes:
        radius_m: Radius of the ball, at most 0.6 m.
        mass_kg: Mass of the ball, at most `WalkerCfg.push_limit_kg` of the player.
        speed_mps: Least and greatest speed at which the ball leaves the wall.
        spread_deg: Largest angle between its direction and the wall's normal, in [0, 90).
        life_s: Time after which a ball that has not been kicked is replaced.
        rest_s: Time after which a kicked ball is replaced.
        loudness: Level of the ball's sound, see `SoundCfg`.
        sound_path: WAV file that the ball sounds like, repeated without end and scaled to
            `loudness`; None is a buzz.
        pulse_s: Duration of a pulse of its sound, if there are pauses.
        pause_s: Silence between pulses: an agent then needs memory; 0 is a continuous sound.
        walking_mps: Speed of the player below which the term `approach` is 0.
    """

    radius_m: float = 0.15
    mass_kg: float = 0.3
    speed_mps: tuple[float, float] = (0.5, 1.0)
    spread_deg: float = 30.0
    life_s: float = 6.0
    rest_s: float = 0.4
    loudness: float = 0.1
    sound_path: str | None = None
    pulse_s: float = 0.2
    pause_s: float = 0.0
    walking_mps: float = 0.35
    weights: dict[str, float] = terms(kick=1.0, approach=0.01)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("radius_m", "mass_kg", "pulse_s")
        self.check_not_negative("loudness", "walking_mps")
        if self.radius_m > _LARGEST_RADIUS_M:
            raise ValueError(
                f"task.radius_m={self.radius_m} must be at most {_LARGEST_RADIUS_M}: a larger ball "
                "could touch the player at the start"
            )
        if not 0.0 <= self.spread_deg < 90.0:
            raise ValueError(
                f"task.spread_deg={self.spread_deg} must be in [0, 90): the ball leaves the wall"
            )
        slow, fast = self.speed_mps
        if not 0.0 < slow <= fast < math.inf:
            raise ValueError(f"task.speed_mps={self.speed_mps} must be (least, greatest), above 0")
        for name in ("life_s", "rest_s"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"task.{name}={getattr(self, name)} must be positive")
        self.sound()

    def sound(self) -> SoundCfg:
        """Return the sound of the ball."""
        return SoundCfg(
            SoundKind.buzz if self.sound_path is None else SoundKind.clip,
            level=self.loudness,
            path=self.sound_path,
            pulse_s=self.pulse_s,
            pause_s=self.pause_s,
        )


@register_task
class KickTheBall(Task):
    """A buzzing ball rolls out of a side wall again and again; the player has to kick it.

    The default field of view is 60 degrees, so that hearing is needed to find the ball. A ball
    within reach of the foot (`Walker.can_kick`) is kicked automatically and counts once. `rest_s`
    later, or `life_s` after the start of a ball that was not kicked, the next ball leaves the left
    (+y) or the right (-y) wall. An episode lasts `max_seconds` and never terminates.

    The sound, the walls and the helper reward are those of the paper (table of tasks and "Helper
    Rewards" in the appendix). The paper gives no numbers apart from the helper reward's weight.
    Departure from the paper: `approach` is 0 below a least speed, because one of three policies
    learnt to creep backwards towards the ball without kicking it. A player that walks towards the
    ball faster than that, and away from it more slowly, still receives `approach` without kicking.

    Terms:
        kick: 1 on the step in which the ball is kicked, else 0.
        approach: Cosine of the angle between the velocity of the player and the displacement to
            the ball, both horizontal, in [-1, 1]; 0 while the player is slower than `walking_mps`.
    """

    senses = ("vision", "audio")
    rates = ("approach",)
    body_cfg = WalkerCfg
    cfg: KickTheBallCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        room, least_m = playground.rooms[0], 2.0 * _START_CLEARANCE_M
        if min(room.size_m[:2]) < least_m:
            raise ValueError(
                f"KickTheBall takes place in the first room of a playground; room {room.name!r} of "
                f"{playground.name!r} has size_m={tuple(room.size_m)}, but needs {least_m} m along "
                "x and y; choose playground=simple, single_room, house, house2 or random_house"
            )

    @classmethod
    def check_clock(cls, cfg: Any, clock: ClockCfg) -> None:
        check_ball_speed(cfg.speed_mps[1], cfg.radius_m, clock)

    def build(self) -> None:
        self.kicker = require_walker(self.players[0])
        self.room = self.world.playground.rooms[0]
        self.ball = self.world.add_prop(
            PropCfg(
                name="ball",
                shape=PropShape.sphere,
                size_m=[self.cfg.radius_m],
                mass_kg=self.cfg.mass_kg,
                colour=(0.95, 0.15, 0.1),
                sound=self.cfg.sound(),
            )
        )
        check_kickable(self.players, self.ball)
        self._kicked = self._kicked_now = False
        self._steps_left = 0

    def reset(self, rng: np.random.Generator) -> None:
        start = self.room.sample_floor(rng, margin_m=_START_CLEARANCE_M)
        self.kicker.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        self._launch(rng)

    def before_step(self, rng: np.random.Generator) -> None:
        if self._steps_left == 0:
            self._launch(rng)
        self._steps_left -= 1

    def after_step(self, rng: np.random.Generator) -> None:
        self._kicked_now = not self._kicked and self.kicker.kick(self.ball)
        if self._kicked_now:
            self._kicked, self._steps_left = True, self._steps(self.cfg.rest_s)

    def reward(self, player: Player) -> dict[str, float]:
        way, velocity = horizontal(self.ball.position - self.kicker.position), self.kicker.velocity
        walks = norm(velocity) >= self.cfg.walking_mps
        approach = cosine(velocity, way) if walks else 0.0
        return {"kick": float(self._kicked_now), "approach": approach}

    def state(self) -> dict[str, float]:
        left_s = self._steps_left * self.world.clock.step_s
        return {"kicked": float(self._kicked), "left_s": left_s}

    def _launch(self, rng: np.random.Generator) -> None:
        """Launch the ball; a start within the player is drawn again, up to `_MOST_DRAWS` times."""
        cfg, bodies = self.cfg, (self.kicker.body_id, self.ball.body_id)
        for _ in range(_MOST_DRAWS):
            launch_from_side_wall(self.ball, self.room, cfg.speed_mps, cfg.spread_deg, rng)
            if penetration_m(self.world.client, *bodies) == 0.0:
                break
        self._kicked = self._kicked_now = False
        self._steps_left = self._steps(self.cfg.life_s)

    def _steps(self, seconds: float) -> int:
        """Return the number of agent steps that is nearest to a time, at least 1."""
        return max(1, round(seconds / self.world.clock.step_s))

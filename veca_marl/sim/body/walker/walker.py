"""The walking body: the paper's animation-based agent.

A capsule in the physics, 47 bones posed by our own forward kinematics, so that other eyes see a
child walk, turn and kick. It never falls; joint-level bodies do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action
from veca_marl.sim.body.anatomy.skeleton import Soles, forward_kinematics
from veca_marl.sim.body.base import BodyCfg
from veca_marl.sim.body.figure import Figure
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.voice import voice_spec
from veca_marl.sim.body.walker.controls import WALK_CONTROLS, ActionKind
from veca_marl.sim.body.walker.crowd import crowd_of
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.pushing import Pusher, horizontal_distance
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import Prop
from veca_marl.sim.physics.world import World
from veca_marl.sim.sound.calls import Call

MOVE = "move"  # the part of the action that walks


@dataclass
class WalkerCfg(BodyCfg):
    """Numbers of the walking body. The paper leaves them open; these are ours.

    Attributes:
        action: Continuous velocities or discrete moves.
        walk_speed_mps: Speed of a full forward action.
        backward_share: A full backward action goes at this share of the forward speed.
        turn_speed_degps: Turning speed of a full turn action.
        radius_m: Radius of the capsule in the physics.
        height_m: Height of the capsule.
        push_limit_kg: Things up to this mass are pushed, heavier ones stop the walker.
        kick_reach_m: From the capsule's surface to the kicked thing's.
        kick_angle_deg: A thing farther than this to the side is not in reach of the foot.
        kick_height_m: Nor is one whose lowest point is higher than this.
        kick_speed_mps: Speed of a kicked light thing.
        kick_impulse_ns: The most a kick can give: heavy things fly slower.
        head_pitch_deg: How far the head hangs at the start of an episode, down is positive.
    """

    action: ActionKind = ActionKind.continuous
    walk_speed_mps: float = 1.0
    backward_share: float = 0.3
    turn_speed_degps: float = 120.0
    radius_m: float = 0.11
    height_m: float = 0.72
    push_limit_kg: float = 5.0
    kick_reach_m: float = 0.15
    kick_angle_deg: float = 60.0
    kick_height_m: float = 0.25
    kick_speed_mps: float = 3.0
    kick_impulse_ns: float = 3.0
    head_pitch_deg: float = 12.0

    def __post_init__(self) -> None:
        """All are magnitudes, and a capsule is higher than wide."""
        self._check_choices(action=ActionKind)
        super().__post_init__()
        if not 0.0 < 2.0 * self.radius_m <= self.height_m:
            raise ValueError(
                f"body.radius_m={self.radius_m}, body.height_m={self.height_m}: "
                "the radius must be positive and at most half the height"
            )


class Walker(Figure):
    """A body that walks where it is told. See `Body` for what every body offers."""

    def __init__(self, name: str, cfg: WalkerCfg, world: World, shirt: int = 0) -> None:
        super().__init__(name, cfg.eye_range_deg, world, shirt)
        self.cfg = cfg
        self._control = WALK_CONTROLS[cfg.action]
        self.action_spec = {MOVE: self._control.spec, **voice_spec(cfg.voice)}
        self._gait = Gait(self._skeleton)
        self._pusher = Pusher(world.client, cfg.radius_m, cfg.height_m, cfg.push_limit_kg)
        self._soles = Soles(self._skeleton)
        self.reset()
        crowd_of(world).join(self)

    # ---- where it is

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: mean velocity over the last agent step, as obstacles allowed it."""
        return self._velocity.copy()

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector the trunk faces."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad), 0.0])

    @property
    def radius_m(self) -> float:
        """Radius of the capsule that stands for it in the physics."""
        return self.cfg.radius_m

    def place(self, position: Floats | tuple[float, float, float], yaw_rad: float = 0.0) -> None:
        """Start anew: stand at a place of the floor, facing `yaw_rad`, looking ahead.

        In a place that is taken by a wall or by something heavy it is pushed out to the side.

        Raises:
            ValueError: If a number is not finite.
        """
        self._ground = np.array([float(position[0]), float(position[1])])
        if not (np.isfinite(self._ground).all() and math.isfinite(yaw_rad)):
            raise ValueError(f"{self.name}: cannot stand at {position!r}, facing {yaw_rad!r} rad")
        self.yaw_rad = float(yaw_rad)
        self._speed_mps = self._turn_radps = 0.0
        self._velocity = np.zeros(3)
        for motion in (self._speeds, self._pelvis_velocity, self._pelvis_spin):
            motion[:] = 0.0
        self._head_pitch_rad = math.radians(self.cfg.head_pitch_deg)
        self._head_yaw_rad = 0.0
        self._relax_eyes()
        self._gait.reset()
        self._look_round(0.0)
        self._ground[:] = self._pusher.move(self._ground[0], self._ground[1])
        self._pusher.tell_velocity(0.0, 0.0, 0.0)
        self._step_start = self._ground.copy()
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    # ---- what it can do (the paper's animation-based API)

    def _move(self, parts: Action) -> None:
        forward, turn = self._control.decode(parts[MOVE])
        top_mps = self.cfg.walk_speed_mps * (self.cfg.backward_share if forward < 0.0 else 1.0)
        self.walk(forward * top_mps, turn * math.radians(self.cfg.turn_speed_degps))

    def rest(self) -> None:
        """Stand where it is."""
        self.walk(0.0, 0.0)

    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action nearest to a command ``(forward, turn)``, each in [-1, 1].

        A third element is the `Call`; without it no call is chosen.
        """
        forward, turn, *call = command
        move = self._control.encode(forward, turn)
        return self._with_voice({MOVE: move}, Call(call[0]) if call else Call.none)

    @property
    def is_finite(self) -> bool:
        """It is moved by hand and stays finite."""
        return True

    def walk(self, walk_speed_mps: float, turn_speed_radps: float) -> None:
        """Walk forward (backward when negative) and turn (left when positive) until told anew."""
        if not (math.isfinite(walk_speed_mps) and math.isfinite(turn_speed_radps)):
            raise ValueError(f"cannot walk at {walk_speed_mps} m/s, {turn_speed_radps} rad/s")
        self._speed_mps, self._turn_radps = walk_speed_mps, turn_speed_radps

    def can_kick(self, prop: Prop) -> bool:
        """Say whether a thing is light enough, near enough and before the feet."""
        here, there = self.position, prop.position
        gap = horizontal_distance(here, there) - self.radius_m - prop.radius_m
        light = not prop.fixed and prop.cfg.mass_kg <= self.cfg.push_limit_kg
        if gap > self.cfg.kick_reach_m or not light or prop.lowest_m > self.cfg.kick_height_m:
            return False
        ahead = math.atan2(there[1] - here[1], there[0] - here[0]) - self.yaw_rad
        aside = abs((ahead + math.pi) % (2.0 * math.pi) - math.pi)
        return aside <= math.radians(self.cfg.kick_angle_deg)

    def kick(self, prop: Prop) -> bool:
        """Kick a thing away; return False, and do nothing, if it is out of reach."""
        if not self.can_kick(prop):
            return False
        way = prop.position - self.position
        way[2] = 0.0
        way /= max(float(np.linalg.norm(way)), 1e-9)
        speed = min(self.cfg.kick_speed_mps, self.cfg.kick_impulse_ns / prop.cfg.mass_kg)
        prop.set_velocity(speed * way + np.array([0.0, 0.0, 0.2 * speed]))
        self._gait.kick()
        return True

    def rotate_up_down_head(self, deg: float) -> None:
        """Turn the head down (up when negative) by so many degrees, as far as the neck allows."""
        _check_degrees(deg)
        low, high = self._gait.pitch_range_rad
        self._head_pitch_rad = min(max(self._head_pitch_rad + math.radians(deg), low), high)

    def rotate_left_right_head(self, deg: float) -> None:
        """Turn the head right (left when negative) by so many degrees, as the neck allows."""
        _check_degrees(deg)
        low, high = self._gait.yaw_range_rad
        self._head_yaw_rad = min(max(self._head_yaw_rad - math.radians(deg), low), high)

    # ---- the world moves it

    def reset(self) -> None:
        """Stand where it was built, say nothing. The task usually puts it elsewhere."""
        self.place((0.0, 0.0, 0.0))

    def before_step(self) -> None:
        """Note what it could bump into during this agent step."""
        self._step_start = self._ground.copy()
        self._look_round(abs(self._speed_mps) * self._world.clock.step_s)

    def stride(self, substep_s: float) -> tuple[float, float]:
        """Turn, and say where one physics step would lead; see `Member`."""
        self.yaw_rad += self._turn_radps * substep_s
        reach = self._speed_mps * substep_s
        x, y = self._ground
        return x + reach * math.cos(self.yaw_rad), y + reach * math.sin(self.yaw_rad)

    def squeeze(self, x: float, y: float) -> tuple[float, float]:
        """Return where obstacles let it stand; see `Member`."""
        return self._pusher.move(x, y)

    def stand(self, x: float, y: float, substep_s: float) -> None:
        """Be at a place after this physics step; see `Member`."""
        vx, vy = (x - self._ground[0]) / substep_s, (y - self._ground[1]) / substep_s
        self._ground[:] = x, y
        self._pusher.tell_velocity(vx, vy, self._turn_radps)

    def mirror(self) -> None:
        """Take up the gait's pose and let the voice come from the mouth."""
        step_s = self._world.clock.step_s
        self._velocity[:2] = (self._ground - self._step_start) / step_s
        speed = float(self._velocity @ self.forward)
        self._gait.advance(speed, self._turn_radps, step_s)
        before = self._angles.copy()
        self._pose_bones()
        self._speeds[:] = (self._angles - before) / step_s
        self._pelvis_velocity[:] = self._velocity
        self._pelvis_spin[2] = self._turn_radps
        self._mouth.position = self.mount("mouth").position

    def _look_round(self, way_m: float) -> None:
        """Note which things and joint-level bodies are near."""
        movers = self._world.movers
        jointed = [one.articulation.body_id for one in movers if isinstance(one, Humanoid)]
        self._pusher.look_round(self._world.props, jointed, self._ground, way_m)

    def _pose_bones(self) -> None:
        """Stand on the lower foot: forward kinematics, then shift all bones vertically."""
        positions, rotations = self._drawn.positions, self._drawn.rotations
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        positions[0] = self._ground[0], self._ground[1], 0.0
        rotations[0] = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
        angles = self._gait.pose(self._head_pitch_rad, self._head_yaw_rad)
        self._angles[:] = angles
        forward_kinematics(self._skeleton, angles, positions, rotations)
        positions[:, 2] -= self._soles.lowest_m(positions, rotations)


def _check_degrees(deg: float) -> None:
    if not math.isfinite(deg):
        raise ValueError(f"cannot turn the head by {deg} degrees")

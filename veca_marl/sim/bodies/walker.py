"""The walking body: the paper's animation-based agent.

A capsule in the physics, 47 bones posed by our own forward kinematics, so that other eyes see a
child walk, turn and kick. It never falls; joint-level bodies do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.bodies.controls import WALK_CONTROLS, ActionKind
from veca_marl.sim.bodies.looks import SHIRTS, bone_geoms
from veca_marl.sim.bodies.mounts import EYES, gaze, organ_pose
from veca_marl.sim.bodies.pushing import Pusher, horizontal_distance
from veca_marl.sim.gait import Gait
from veca_marl.sim.optics import Camera, seen_fraction
from veca_marl.sim.pose import Floats, Pose
from veca_marl.sim.props import Prop
from veca_marl.sim.skeleton import Soles, forward_kinematics, load_skeleton
from veca_marl.sim.sounds import Voice
from veca_marl.sim.world import World


class Visible(Protocol):
    """What eyes can look for: a prop or a body."""

    object_id: int


@dataclass
class WalkerCfg:
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
        eye_range_deg: How far the eyes turn in the head.
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
    eye_range_deg: float = 50.0

    def __post_init__(self) -> None:
        """All are magnitudes, and a capsule is higher than wide."""
        if not isinstance(self.action, ActionKind):
            raise ValueError(
                f"body.action={self.action!r}; there are {[k.name for k in ActionKind]}"
            )
        for name, value in vars(self).items():
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"body.{name}={value} must be a finite number, 0 or more")
        if not 0.0 < 2.0 * self.radius_m <= self.height_m:
            raise ValueError(
                f"body.radius_m={self.radius_m}, body.height_m={self.height_m}: "
                "the radius must be positive and at most half the height"
            )


class Walker:
    """A body that walks where it is told. See `Body` for what every body offers."""

    def __init__(self, name: str, cfg: WalkerCfg, world: World, shirt: int = 0) -> None:
        self.name = name
        self.cfg = cfg
        self.control = WALK_CONTROLS[cfg.action]
        self.action_spec = self.control.spec
        self._world = world
        self._skeleton = load_skeleton()
        self._gait = Gait(self._skeleton)
        self._pusher = Pusher(world.client, cfg.radius_m, cfg.height_m, cfg.push_limit_kg)
        drawn = world.scene.add_object(
            name, bone_geoms(self._skeleton, SHIRTS[shirt % len(SHIRTS)])
        )
        self.object_id = drawn.id
        self._drawn = drawn
        self._head = self._skeleton.bone("head")
        self._soles = Soles(self._skeleton)
        self.own_head_frames = (self._skeleton.bone("neck"), self._head)
        self._voice = Voice(world.sound.sample_rate_hz)
        self._mouth = world.sound.add_source(f"{name}.voice", self._voice)
        self.camera = Camera()
        world.attach(self)
        self.reset()

    # ---- where it is

    @property
    def position(self) -> Floats:
        """``(3,)`` metres: the pelvis in the world frame."""
        return np.array(self._drawn.positions[0])

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

    def bone(self, name: str) -> Pose:
        """Return the pose of a bone by name, such as `l_hand`."""
        index = self._skeleton.bone(name)
        return Pose(self._drawn.positions[index].copy(), self._drawn.rotations[index].copy())

    def mount(self, name: str) -> Pose:
        """Return where a sense organ is; eyes include where they are turned to."""
        head = Pose(self._drawn.positions[self._head], self._drawn.rotations[self._head])
        organ = organ_pose(name, head)
        if name in EYES and self._gaze_point is not None:
            return gaze(organ, self._gaze_point, math.radians(self.cfg.eye_range_deg))
        return organ

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
        self._head_pitch_rad = math.radians(self.cfg.head_pitch_deg)
        self._head_yaw_rad = 0.0
        self._gaze_point: Floats | None = None
        self.focal_distance_m = math.inf
        self._gait.reset()
        self._pusher.look_round(self._world.props, self._ground, 0.0)
        self._ground[:] = self._pusher.move(self._ground[0], self._ground[1])
        self._pusher.tell_velocity(0.0, 0.0, 0.0)
        self._step_start = self._ground.copy()
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    # ---- what it can do (the paper's animation-based API)

    def act(self, action: NDArray[Any]) -> None:
        """Walk as an action row says; it holds until the next call."""
        forward, turn = self.control.decode(action)
        top_mps = self.cfg.walk_speed_mps * (self.cfg.backward_share if forward < 0.0 else 1.0)
        self.walk(forward * top_mps, turn * math.radians(self.cfg.turn_speed_degps))

    def walk(self, walk_speed_mps: float, turn_speed_radps: float) -> None:
        """Walk forward (backward when negative) and turn (left when positive) until told anew."""
        if not (math.isfinite(walk_speed_mps) and math.isfinite(turn_speed_radps)):
            raise ValueError(f"cannot walk at {walk_speed_mps} m/s, {turn_speed_radps} rad/s")
        self._speed_mps, self._turn_radps = walk_speed_mps, turn_speed_radps

    def can_kick(self, prop: Prop) -> bool:
        """Say whether a thing is light enough, near enough and before the feet."""
        gap = horizontal_distance(self.position, prop.position) - self.radius_m - prop.radius_m
        way = prop.position - self.position
        ahead = math.atan2(way[1], way[0]) - self.yaw_rad
        aside = abs((ahead + math.pi) % (2.0 * math.pi) - math.pi)
        light = not prop.fixed and prop.cfg.mass_kg <= self.cfg.push_limit_kg
        return (
            light
            and gap <= self.cfg.kick_reach_m
            and aside <= math.radians(self.cfg.kick_angle_deg)
            and prop.lowest_m <= self.cfg.kick_height_m
        )

    def kick(self, prop: Prop) -> bool:
        """Kick a thing away; return False, and do nothing, if it is out of reach."""
        if not self.can_kick(prop):
            return False
        way = prop.position - self.position
        way[2] = 0.0
        way /= max(float(np.linalg.norm(way)), 1e-9)
        speed = min(self.cfg.kick_speed_mps, self.cfg.kick_impulse_ns / prop.cfg.mass_kg)
        prop.push(speed * way + np.array([0.0, 0.0, 0.2 * speed]))
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

    def look_toward_point(self, point: Floats | tuple[float, float, float]) -> None:
        """Turn the eyes, not the head, to a point and keep them there until `release_look`."""
        target = np.array(point, dtype=np.float64)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise ValueError(f"cannot look toward {point!r}: three finite metres are needed")
        self._gaze_point = target

    def release_look(self) -> None:
        """Let the eyes look straight ahead again."""
        self._gaze_point = None

    def adjust_focal_length(self, focal_distance_m: float) -> None:
        """Adjust the lenses to a distance in metres; ``inf`` is relaxed."""
        if not focal_distance_m > 0:
            raise ValueError(f"focal distance {focal_distance_m} must be positive metres or inf")
        self.focal_distance_m = float(focal_distance_m)

    def make_sound(self, waveform: NDArray[np.float32]) -> None:
        """Say something: samples at 22 050 Hz, heard by everyone, the speaker included."""
        self._voice.say(waveform)

    def is_visible(self, thing: Visible, eye: str = "eye_left") -> bool:
        """Say whether an eye sees a thing, also through glass (the paper's `isVisible`).

        Args:
            thing: A prop or a body.
            eye: ``eye_left`` or ``eye_right``; it sees through `camera`, by default as sharply as
                the vision sense does.
        """
        if eye not in EYES:
            raise ValueError(f"no eye {eye!r}; there are {list(EYES)}")
        scene = self._world.scene
        own_head = scene.hidden(self.object_id, self.own_head_frames)
        views = self.camera.render(scene, [self.mount(eye)], own_head)
        return seen_fraction(views, thing.object_id) > 0.0

    # ---- the world moves it

    def reset(self) -> None:
        """Stand where it was built, say nothing. The task usually puts it elsewhere."""
        self.place((0.0, 0.0, 0.0))

    def before_step(self) -> None:
        """Note what it could bump into during this agent step."""
        self._step_start = self._ground.copy()
        way_m = abs(self._speed_mps) * self._world.clock.step_s
        self._pusher.look_round(self._world.props, self._step_start, way_m)

    def before_substep(self, substep_s: float) -> None:
        """Walk on by one physics step, as far as obstacles and other walkers allow."""
        self.yaw_rad += self._turn_radps * substep_s
        reach = self._speed_mps * substep_s
        old_x, old_y = self._ground
        x, y = old_x + reach * math.cos(self.yaw_rad), old_y + reach * math.sin(self.yaw_rad)
        x, y = self._pusher.move(*self._make_room(x, y))
        self._ground[:] = x, y
        self._pusher.tell_velocity(
            (x - old_x) / substep_s, (y - old_y) / substep_s, self._turn_radps
        )

    def mirror(self) -> None:
        """Take up the gait's pose and let the voice come from the mouth."""
        step_s = self._world.clock.step_s
        self._velocity[:2] = (self._ground - self._step_start) / step_s
        speed = float(self._velocity @ self.forward)
        self._gait.advance(speed, self._turn_radps, step_s)
        self._pose_bones()
        self._mouth.position = self.mount("mouth").position

    def _make_room(self, x: float, y: float) -> tuple[float, float]:
        """Step back from other walkers; each of two gives way by half."""
        aside = -1.0
        for other in self._world.movers:
            if other is self:
                aside = 1.0
            if other is self or not isinstance(other, Walker):
                continue
            dx, dy = x - other._ground[0], y - other._ground[1]
            distance = math.hypot(dx, dy)
            overlap = self.radius_m + other.radius_m - distance
            if overlap > 0.0:
                if (
                    distance < 1e-9
                ):  # on one spot: those who came first go one way, others the other
                    dx, dy, distance = aside, 0.0, 1.0
                x, y = x + dx / distance * overlap / 2, y + dy / distance * overlap / 2
        return x, y

    def _pose_bones(self) -> None:
        """Stand on the lower foot: forward kinematics, then shift all bones vertically."""
        positions, rotations = self._drawn.positions, self._drawn.rotations
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        positions[0] = self._ground[0], self._ground[1], 0.0
        rotations[0] = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
        angles = self._gait.pose(self._head_pitch_rad, self._head_yaw_rad)
        forward_kinematics(self._skeleton, angles, positions, rotations)
        positions[:, 2] -= self._soles.lowest_m(positions, rotations)


def _check_degrees(deg: float) -> None:
    if not math.isfinite(deg):
        raise ValueError(f"cannot turn the head by {deg} degrees")

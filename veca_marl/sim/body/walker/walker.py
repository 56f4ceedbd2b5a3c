"""The walking body: the paper's animation-based agent.

A capsule in the physics; 47 bones posed by forward kinematics, so that others see a child walk,
turn and kick. It cannot fall.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action
from veca_marl.sim.body.anatomy import forward_kinematics
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.walker.capsule import Capsule
from veca_marl.sim.body.walker.footing import Footing, foot_steps_on, middle
from veca_marl.sim.body.walker.footsteps import Footsteps
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.hand import Hand
from veca_marl.sim.body.walker.kicks import foot_reaches, kicked_velocity
from veca_marl.sim.body.walker.stances import Stance, make_stances
from veca_marl.sim.body.walker.verb_part import REFUSED, VERB, Applied, VerbChoice, verb_spec
from veca_marl.sim.body.walker.walk_commands import WALK_ACTIONS, WalkCommand
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg, greatest_speed_mps
from veca_marl.sim.body.walker.walker_collisions import walker_collisions
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.spec import ArraySpec

MOVE = "move"  # the part of the action that walks


class Walker(Body):
    """A body that moves at commanded velocities. See `Body` for the common methods.

    Attributes:
        verb_choice: The chosen verb and its result.
    """

    cfg_type: ClassVar[type[BodyCfg]] = WalkerCfg

    def __init__(self, name: str, cfg: WalkerCfg, world: World, shirt: int = 0) -> None:
        super().__init__(name, cfg, world, shirt)
        self.cfg = cfg
        self._greatest_speed_mps = greatest_speed_mps(cfg, world.clock)
        self._walk_action = WALK_ACTIONS[cfg.action]
        self._gait = Gait(self._skeleton)
        self._upright, self._on_all_fours = make_stances(self._skeleton, self._gait, cfg, world)
        self._stance: Stance = self._upright
        self._hand = Hand(world.client, name, self.body_id, cfg.radius_m)
        self._footing = Footing(world.client)
        self.verb_choice = VerbChoice(cfg.verbs)
        mass_kg = sum(bone.mass_kg for bone in self._skeleton.bones)
        self._footsteps = Footsteps(name, mass_kg, world)
        self.reset()
        walker_collisions(world).add(self)

    def _movement_spec(self, cfg: WalkerCfg) -> dict[str, ArraySpec]:
        return {MOVE: WALK_ACTIONS[cfg.action].spec, **verb_spec(cfg.verbs)}

    # ---- position and velocity

    @property
    def body_id(self) -> int:
        """PyBullet's id of the capsule in use."""
        return self._capsule.body_id

    @property
    def _capsule(self) -> Capsule:
        return self._stance.capsule

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: mean velocity over the last agent step, after contacts."""
        return self._velocity.copy()

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector that the trunk faces."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad), 0.0])

    @property
    def radius_m(self) -> float:
        """Radius of the capsule in the physics."""
        return self.cfg.radius_m

    def place(self, position: Floats | tuple[float, float, float], yaw_rad: float = 0.0) -> None:
        """Stand at a place on the floor, facing `yaw_rad`, looking ahead, with empty hands.

        A held prop is released where it is. If a wall or a heavy obstacle occupies the place, the
        walker is moved out of it sideways.

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
        self._gaze.relax()
        self._hand.drop()
        self.verb_choice.reset()
        self._gait.reset()
        self._stand_on_floor()
        self._collect_obstacles(0.0)
        self._ground[:] = self._capsule.resolve_contacts(self._ground[0], self._ground[1])
        self._capsule.set_velocity(0.0, 0.0, 0.0)
        self._step_start = self._ground.copy()
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    def info(self) -> dict[str, float]:
        """Return `refused_verbs`, 1 after a verb without effect; empty for bodies without verbs."""
        return {REFUSED: float(self.verb_was_refused)} if self.cfg.verbs else {}

    # ---- commands (the paper's animation-based API)

    def _move(self, parts: Action) -> None:
        forward, turn = self._walk_action.decode(parts[MOVE])
        top_mps = self.cfg.walk_speed_mps * (self.cfg.backward_share if forward < 0.0 else 1.0)
        turn_radps = turn * math.radians(self.cfg.turn_speed_degps)
        share = self._stance.speed_share
        self.walk(share * forward * top_mps, share * turn_radps)
        if VERB in parts:
            self.verb_choice.choose(int(parts[VERB]))

    def rest(self) -> None:
        """Stand still."""
        self.walk(0.0, 0.0)

    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action nearest to a command.

        Args:
            command: A `WalkCommand`, or a tuple of its first elements.

        Raises:
            ValueError: If the command names a verb that is not in `WalkerCfg.verbs`.
        """
        forward, turn, call, verb = WalkCommand(*command)
        parts: dict[str, NDArray[Any]] = {MOVE: self._walk_action.encode(forward, turn)}
        choice = self.verb_choice.index(verb)
        if VERB in self.action_spec:
            parts[VERB] = np.asarray(choice, np.int64)
        return self._with_voice(parts, call)

    def walk(self, walk_speed_mps: float, turn_speed_radps: float) -> None:
        """Walk at constant speeds until the next command.

        Args:
            walk_speed_mps: Forward; negative is backward.
            turn_speed_radps: To the left; negative is to the right.

        Raises:
            ValueError: If a speed is not finite, or the walking speed is above
                `greatest_speed_mps` of its configuration and the world's clock.
        """
        limit = self._greatest_speed_mps
        if not (abs(walk_speed_mps) <= limit and math.isfinite(turn_speed_radps)):
            raise ValueError(
                f"{self.name}: cannot walk at {walk_speed_mps} m/s, {turn_speed_radps} rad/s; "
                f"at most {limit:.4g} m/s, further than which a physics step could pass a wall"
            )
        self._speed_mps, self._turn_radps = walk_speed_mps, turn_speed_radps

    def can_kick(self, prop: Prop) -> bool:
        """Return whether a kick would reach a prop.

        The prop is light enough, near enough, low enough and ahead, and nothing solid is on the
        line of contact: the horizontal line from the capsule towards the prop's centre, at the
        height of the centre or of `kick_height_m`, whichever is lower.
        """
        if self.crawls or not self._is_loose(prop):
            return False
        return foot_reaches(self._world.client, self.cfg, self.position, self.yaw_rad, prop)

    def kick(self, prop: Prop) -> bool:
        """Kick a prop away from the walker; return False, and do nothing, if it cannot."""
        if not self.can_kick(prop):
            return False
        prop.set_velocity(kicked_velocity(self.cfg, self.position, prop))
        self._gait.kick()
        return True

    @property
    def held(self) -> Prop | None:
        """The prop in its hand; None if the hand is empty."""
        return self._hand.prop

    def is_light(self, prop: Prop) -> bool:
        """Return whether it pushes, kicks and carries a prop: the paper's light objects."""
        return not prop.fixed and prop.cfg.mass_kg <= self.cfg.push_limit_kg

    def can_grab(self, prop: Prop) -> bool:
        """Return whether a hand is free, and a prop is light, without joint and held by no body."""
        return self.held is None and self._stance.hands_are_free and self._is_loose(prop)

    def _is_loose(self, prop: Prop) -> bool:
        """Return whether a prop is light, without joint and held by no body."""
        return prop.holder is None and prop.joint is None and self.is_light(prop)

    def grab(self, prop: Prop) -> bool:
        """Take a prop into the right hand; return False, and do nothing, if it cannot.

        From now on the prop follows the hand, at any distance at which it was before.
        """
        if not self.can_grab(prop):
            return False
        self._hand.take(prop, self.yaw_rad)
        self._gait.carrying = True
        self._pose_bones()
        self._follow_palm()
        return True

    def release(self) -> bool:
        """Release the held prop, which falls; return False if the hand is empty."""
        if self.held is None:
            return False
        self._hand.drop()
        self._gait.carrying = False
        return True

    def can_step_on(self, prop: Prop) -> bool:
        """Return whether it stands on the floor and a prop is heavy, low and within reach."""
        if self._footing.prop is not None or self.crawls or self.is_light(prop):
            return False
        return foot_steps_on(self._world.client, self.cfg, self._ground, prop)

    def step_on(self, prop: Prop) -> bool:
        """Step onto the middle of a prop; return False, and do nothing, if it cannot.

        The walker walks on its surface, and steps down where it walks over an edge.
        """
        if not self.can_step_on(prop):
            return False
        self._footing.step_on(prop)
        self._ground[:] = middle(prop)
        self._capsule.support_id = prop.body_id
        self._follow_surface()
        return True

    @property
    def crawls(self) -> bool:
        """Whether it is on hands and knees."""
        return self._stance is self._on_all_fours

    def crawl(self) -> bool:
        """Go down on hands and knees: lower, slower, and longer.

        Returns:
            False, without effect, if it crawls already, holds something, stands on a prop, or there
            is no room for the longer body.

        Raises:
            RuntimeError: If `WalkerCfg.verbs` does not name `crawl`.
        """
        if self._on_all_fours is None:
            raise RuntimeError(f"{self.name} cannot crawl: body.verbs={self.cfg.verbs}")
        if self.crawls or self.held is not None or self._footing.prop is not None:
            return False
        return self._change_stance(self._on_all_fours)

    def stand_up(self) -> bool:
        """Stand up; return False, without effect, if it stands or there is no room above it."""
        return self.crawls and self._change_stance(self._upright)

    def _change_stance(self, stance: Stance) -> bool:
        """Take a stance where its capsule is free of obstacles; return whether it is."""
        before, self._stance = self._stance, stance
        self._collect_obstacles(0.0)
        stance.turn(self.yaw_rad)
        if self._capsule.overlaps(*self._ground):
            self._capsule.park()
            self._stance = before
            return False
        before.capsule.park()
        return True

    def _stand_on_floor(self) -> None:
        """Stand upright on the floor."""
        self._footing.leave()
        if self._on_all_fours is not None:
            # disabling contacts with new obstacles within an episode would alter other contacts
            self._stance = self._on_all_fours
            self._collect_obstacles(0.0)
            self._capsule.park()
        self._stance = self._upright
        self._capsule.base_m, self._capsule.support_id = 0.0, -1

    def _follow_surface(self) -> None:
        """Set the height of the capsule to that of the surface under it."""
        self._footing.follow(*self._ground)
        self._capsule.base_m = self._footing.height_m
        if self._footing.prop is None:
            self._capsule.support_id = -1

    @property
    def applied_verb(self) -> Applied | None:
        """The verb of its action that had an effect in the last step; None if there was none."""
        return self.verb_choice.applied

    @property
    def verb_was_refused(self) -> bool:
        """Whether its action chose a verb in the last step that had no effect."""
        return self.verb_choice.refused

    def rotate_up_down_head(self, deg: float) -> None:
        """Pitch the head down (up when negative) by an angle, within the range of the neck."""
        _check_degrees(deg)
        low, high = self._gait.pitch_range_rad
        self._head_pitch_rad = min(max(self._head_pitch_rad + math.radians(deg), low), high)

    def rotate_left_right_head(self, deg: float) -> None:
        """Turn the head right (left when negative) by an angle, within the range of the neck."""
        _check_degrees(deg)
        low, high = self._gait.yaw_range_rad
        self._head_yaw_rad = min(max(self._head_yaw_rad - math.radians(deg), low), high)

    # ---- calls from the world, see `Mover` and `CollidingWalker`

    def before_step(self) -> None:
        """Collect the obstacles that can be reached within this agent step."""
        self._step_start = self._ground.copy()
        self._collect_obstacles(abs(self._speed_mps) * self._world.clock.step_s)

    def proposed_position(self, substep_s: float) -> tuple[float, float]:
        """Turn, and return where it would be after this physics step without obstacles."""
        self.yaw_rad += self._turn_radps * substep_s
        self._stance.turn(self.yaw_rad)
        distance = self._speed_mps * substep_s
        x, y = self._ground
        return x + distance * math.cos(self.yaw_rad), y + distance * math.sin(self.yaw_rad)

    def resolve_contacts(self, x: float, y: float) -> tuple[float, float]:
        """Return the position nearest to ``(x, y)`` outside walls and heavy things."""
        return self._capsule.resolve_contacts(x, y)

    def set_position(self, x: float, y: float, substep_s: float) -> None:
        """Take a position at the end of this physics step."""
        vx, vy = (x - self._ground[0]) / substep_s, (y - self._ground[1]) / substep_s
        self._ground[:] = x, y
        self._capsule.set_velocity(vx, vy, self._turn_radps)
        if self._footing.prop is not None:
            self._follow_surface()
        if self.held is not None:
            self._hand.follow(self._ground, self.yaw_rad, (vx, vy, 0.0))

    def write_frames(self) -> None:
        """Pose the bones by the gait and move the voice to the mouth."""
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
        self._footsteps.follow(self.position, self._gait.landing_mps)
        if self.held is not None:
            self._follow_palm()

    def _follow_palm(self) -> None:
        """Move the held prop to the present place of the palm."""
        self._hand.set_palm(self.palms()[1], self._ground, self.yaw_rad)
        vx, vy, _ = self._velocity
        self._hand.follow(self._ground, self.yaw_rad, (float(vx), float(vy), 0.0))

    def _collect_obstacles(self, distance_m: float) -> None:
        movers = self._world.movers
        bodies = [id_ for mover in movers if isinstance(mover, Body) for id_ in mover.obstacle_ids]
        self._capsule.collect_obstacles(self._world.props, bodies, self._ground, distance_m)

    def _pose_bones(self) -> None:
        """Compute all bone poses; shift them vertically so that it touches the surface."""
        positions, rotations = self._drawn.positions, self._drawn.rotations
        positions[0], rotations[0] = self._stance.pelvis(self._ground, self.yaw_rad)
        angles = self._stance.angles(self._head_pitch_rad, self._head_yaw_rad)
        self._angles[:] = angles
        forward_kinematics(self._skeleton, angles, positions, rotations)
        lowest_m = self._stance.underside.lowest_m(positions, rotations)
        positions[:, 2] -= lowest_m - self._footing.height_m


def _check_degrees(deg: float) -> None:
    if not math.isfinite(deg):
        raise ValueError(f"cannot turn the head by {deg} degrees")

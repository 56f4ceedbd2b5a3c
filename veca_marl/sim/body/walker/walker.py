"""The walking body: the paper's animation-based agent.

A capsule in the physics; 47 bones posed by forward kinematics, which show other agents a child that
walks, turns and kicks. It cannot fall.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.walker.actions import (
    REFUSED,
    VERB,
    WALK_ACTIONS,
    Applied,
    VerbChoice,
    WalkCommand,
    verb_spec,
)
from veca_marl.sim.body.walker.eyes import kept_inside
from veca_marl.sim.body.walker.feet import foot_steps_on
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.ground_motion import Footsteps, GroundMotion
from veca_marl.sim.body.walker.handling import ObjectHandling
from veca_marl.sim.body.walker.stances import BonePoses, make_stances
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg, greatest_speed_mps, sized
from veca_marl.sim.body.walker.walker_collisions import Footprint, walker_collisions
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.physics.interactions import Close, Open
from veca_marl.sim.sense import ArraySpec

MOVE = "move"  # the part of the action that walks
_LOWEST_EDGE_M = 0.02


class Walker(Body):
    """A body that moves at commanded velocities. See `Body` for the common methods.

    Attributes:
        cfg: Its parameters, in proportion to its size.
        verb_choice: The chosen verb and its result.
    """

    cfg_type: ClassVar[type[BodyCfg]] = WalkerCfg

    def __init__(self, name: str, cfg: WalkerCfg, world: World, shirt: int = 0) -> None:
        super().__init__(name, cfg, world, shirt)
        self.cfg = cfg = sized(cfg)
        self._greatest_speed_mps = greatest_speed_mps(cfg, world.clock)
        self._walk_action = WALK_ACTIONS[cfg.action]
        self._gait = Gait(self._skeleton)
        self._motion = GroundMotion(
            world, cfg, *make_stances(self._skeleton, self._gait, cfg, world)
        )
        self._handling = ObjectHandling(world.client, name, cfg, self._motion, self._gait)
        world.settings.append(self._handling.grip)
        self._bone_poses = BonePoses(self._skeleton, self._drawn)
        self.verb_choice = VerbChoice(cfg.verbs)
        self._footsteps = Footsteps(name, self._skeleton.mass_kg, world)
        self._posed_on_m = 0.0  # height of the surface for which the bones are posed
        self.reset()
        walker_collisions(world).add(self)

    def _movement_spec(self, cfg: WalkerCfg) -> dict[str, ArraySpec]:
        return {MOVE: WALK_ACTIONS[cfg.action].spec, **verb_spec(cfg.verbs)}

    # ---- position and velocity

    @property
    def body_id(self) -> int:
        """PyBullet's id of the capsule in use."""
        return self._motion.capsule.body_id

    @property
    def capsule_ids(self) -> list[int]:
        """PyBullet's ids of the capsules of all stances."""
        return self._motion.capsule_ids

    @property
    def yaw_rad(self) -> float:
        """Heading: 0 along x, counter-clockwise is positive; not wrapped to a circle."""
        return self._motion.yaw_rad

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: mean horizontal velocity over the last agent step, after contacts."""
        return self._motion.velocity.copy()

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector that the trunk faces."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad), 0.0])

    @property
    def radius_m(self) -> float:
        """Radius of the upright capsule in the physics."""
        return self.cfg.radius_m

    @property
    def footprint(self) -> Footprint:
        """The capsule in use on the floor plan."""
        return self._motion.capsule.footprint

    def _kept_eye(self, eye: Pose, to_other_m: float) -> Pose:
        return kept_inside(eye, to_other_m, self._motion.ground, self.footprint)

    def touches(self, prop: Prop) -> bool:
        """See `Body.touches`."""
        return super().touches(prop) or self._motion.capsule.touches_obstacle(prop.body_id)

    def place(self, position: Floats | tuple[float, float, float], yaw_rad: float = 0.0) -> None:
        """Stand at a place on the floor, facing `yaw_rad`, looking ahead, with empty hands.

        A held prop is released where it is. If a wall or a heavy obstacle occupies the place, the
        walker is moved out of it sideways.

        Raises:
            ValueError: If a number is not finite.
        """
        x, y, yaw_rad = float(position[0]), float(position[1]), float(yaw_rad)
        if not all(math.isfinite(number) for number in (x, y, yaw_rad)):
            raise ValueError(f"{self.name}: cannot stand at {position!r}, facing {yaw_rad!r} rad")
        for motion in (self._speeds, self._pelvis_velocity, self._pelvis_spin):
            motion[:] = 0.0
        self._bone_poses.reset(math.radians(self.cfg.head_pitch_deg))
        self._gaze.relax()
        self._handling.drop()
        self.verb_choice.reset()
        self._gait.reset()
        self._motion.start(x, y, yaw_rad)
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)
        self._footsteps.teleport(self._surface)

    def info(self) -> dict[str, float]:
        """Return `refused_verbs`, 1 after a verb without effect; empty for bodies without verbs."""
        return {REFUSED: float(self.verb_was_refused)} if self.cfg.verbs else {}

    # ---- commands (the paper's animation-based API)

    def _move(self, parts: Action) -> None:
        forward, turn = self._walk_action.decode(parts[MOVE])
        top_mps = self.cfg.walk_speed_mps * (self.cfg.backward_share if forward < 0.0 else 1.0)
        turn_radps = turn * math.radians(self.cfg.turn_speed_degps)
        share = self._motion.stance.speed_share
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
        self._motion.speed_mps = walk_speed_mps
        self._motion.turn_radps = turn_speed_radps

    def can_kick(self, prop: Prop) -> bool:
        """Return whether a kick would reach a prop.

        The prop is light enough, near enough, low enough and ahead, and nothing solid is on the
        line of contact: the horizontal line from the capsule towards the prop's centre of mass, at
        the height of that centre or of `kick_height_m`, whichever is lower.
        """
        return self._handling.can_kick(prop, self.position)

    def kick(self, prop: Prop | None) -> bool:
        """Kick a prop away from the walker; return False, and do nothing, if it cannot."""
        return prop is not None and self._handling.kick(prop, self.position)

    @property
    def held(self) -> Prop | None:
        """The prop in its hand; None if the hand is empty."""
        return self._handling.held

    def is_light(self, prop: Prop) -> bool:
        """Return whether it pushes, kicks and carries a prop: the paper's light objects."""
        return self._handling.is_light(prop)

    def can_grab(self, prop: Prop) -> bool:
        """Return whether a hand is free, and a prop is light, without joint and held by no body."""
        return self._handling.can_grab(prop)

    def grab(self, prop: Prop | None) -> bool:
        """Take a prop into the right hand; return False, and do nothing, if it cannot.

        From now on the prop follows the hand, at any distance at which it was before. With None,
        as `interactable_object` returns where there is none, nothing is taken.
        """
        if prop is None or not self._handling.grab(prop):
            return False
        self._change_posture()
        self._handling.follow_palm(self.palms()[1])
        prop.teleport_sounds()
        return True

    def release(self) -> bool:
        """Release the held prop, which falls; return False if the hand is empty."""
        if not self._handling.release():
            return False
        self._change_posture()
        return True

    def open(self, prop: Prop | None) -> bool:
        """Open a door, drawer or lid, as the verb `open` does, at any distance.

        Returns:
            False, without effect, if it does not declare the interaction `open`, is open, or is
            locked and its key is not in the hand.
        """
        return prop is not None and Open().attempt(self, prop)

    def close(self, prop: Prop | None) -> bool:
        """Close a door, drawer or lid, as the verb `close` does; see `open`."""
        return prop is not None and Close().attempt(self, prop)

    def can_step_on(self, prop: Prop) -> bool:
        """Return whether it stands on the floor and a prop is heavy, low and within reach.

        Nothing solid is between them, nor where it would stand.
        """
        if self._stands_on_prop or self.crawls or self.is_light(prop):
            return False
        reached = foot_steps_on(self._world.client, self.cfg, self._motion.ground, prop)
        return reached and self._motion.can_step_on(prop)

    def step_on(self, prop: Prop | None) -> bool:
        """Step onto the middle of a prop; return False, and do nothing, if it cannot.

        The walker walks on its surface, and steps down where it walks over an edge.
        """
        if prop is None or not self.can_step_on(prop):
            return False
        self._motion.step_on(prop)
        self._change_posture()
        self._footsteps.teleport(self._surface)
        if self.held is not None:
            self._handling.follow_palm(self.palms()[1])
            self.held.teleport_sounds()
        return True

    @property
    def _stands_on_prop(self) -> bool:
        return self._motion.footing.prop is not None

    @property
    def crawls(self) -> bool:
        """Whether it is on hands and knees."""
        return self._motion.crawls

    def crawl(self) -> bool:
        """Go down on hands and knees: lower, slower, and longer.

        Returns:
            False, without effect, if it crawls already, holds something, stands on a prop, or there
            is no room for the longer body.

        Raises:
            RuntimeError: If `WalkerCfg.verbs` does not name `crawl`.
        """
        if not self._motion.can_crawl:
            raise RuntimeError(f"{self.name} cannot crawl: body.verbs={self.cfg.verbs}")
        if self.crawls or self.held is not None or self._stands_on_prop:
            return False
        if not self._motion.crawl():
            return False
        self._change_posture()
        return True

    def stand_up(self) -> bool:
        """Stand up; return False, without effect, if it stands or there is no room above it."""
        if not (self.crawls and self._motion.stand_up()):
            return False
        self._change_posture()
        return True

    @property
    def applied_verb(self) -> Applied | None:
        """The verb of its action that had an effect in the last step; None if there was none."""
        return self.verb_choice.applied

    @property
    def verb_was_refused(self) -> bool:
        """Whether its action chose a verb in the last step that had no effect."""
        return self.verb_choice.refused

    def rotate_up_down_head(self, deg: float) -> None:
        """Pitch the head down (up when negative) by an angle, clipped to the range of the neck.

        A head that is turned nods about its own axis: heading and roll stay. The range is smaller
        for a turned head, and smaller still on all fours.

        Raises:
            ValueError: If the angle is not finite.
        """
        self._bone_poses.pitch_head(deg, self._motion.stance)

    def rotate_left_right_head(self, deg: float) -> None:
        """Turn the head right (left when negative) by an angle, clipped to the range of the neck.

        The axis is vertical: pitch and roll stay. The range is smaller for a pitched head, and
        smaller still on all fours.

        Raises:
            ValueError: If the angle is not finite.
        """
        self._bone_poses.yaw_head(-deg, self._motion.stance)

    # ---- calls from the world, see `Mover` and `CollidingWalker`

    def before_step(self) -> None:
        """Collect the obstacles that can be reached within this agent step."""
        self._motion.before_step()
        self._handling.before_step(self._world.clock.step_s)

    @property
    def is_clear(self) -> bool:
        """Whether nothing but other walkers can be met in this agent step."""
        return self._motion.is_clear and self.held is None

    @property
    def swept_circle(self) -> tuple[float, float, float]:
        """What it can touch on the floor plan in this agent step: centre and radius, metres."""
        return self._motion.swept_circle

    def walk_freely(self) -> None:
        """Walk for the whole agent step, in which nothing can be met."""
        self._motion.walk_freely()

    def proposed_position(self, substep_s: float) -> tuple[float, float]:
        """Turn; return the position after this physics step without obstacles, metres."""
        return self._motion.proposed_position(substep_s)

    def resolve_contacts(self, x: float, y: float) -> tuple[float, float]:
        """Return the position nearest to ``(x, y)`` outside walls and heavy things."""
        return self._motion.resolve_contacts(x, y)

    def room_for_others(self) -> tuple[float, float]:
        """Return by how much it makes room for what it and other walkers press together, metres."""
        return self._motion.capsule.room_for_others()

    def set_position(self, x: float, y: float, substep_s: float) -> None:
        """Set the position at the end of this physics step."""
        self._motion.set_position(x, y, substep_s)
        self._handling.follow_trunk(substep_s)

    def write_frames(self) -> None:
        """Advance the gait, pose the bones and move the voice to the mouth."""
        motion, step_s = self._motion, self._world.clock.step_s
        motion.after_step()
        self._step_down()
        self._gait.advance(float(motion.velocity @ self.forward), motion.turn_radps, step_s)
        pelvis, angles = self.position, self._angles.copy()
        self._pose_bones()
        self._speeds[:] = (self._angles - angles) / step_s
        self._pelvis_velocity[:] = (self.position - pelvis) / step_s
        self._pelvis_spin[2] = motion.turn_radps
        self._mouth.position = self.mount("mouth").position
        self._footsteps.follow(self._surface, self._gait.landing_mps, self._gait.landings_s)
        if self.held is not None:
            self._handling.follow_palm(self.palms()[1])

    @property
    def _surface(self) -> Floats:
        """The place ``(3,)`` on the floor or prop on which it stands, metres."""
        return np.array([*self._motion.ground, self._motion.footing.height_m])

    def _change_posture(self) -> None:
        """Pose the bones at once: a change of posture takes no time, and is no motion."""
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    def _step_down(self) -> None:
        """Lower the bones at once if it walked over an edge in this step, which is no motion.

        Slopes and rounding are walked on as before: voice and footsteps are not interrupted.
        """
        drop_m = self._posed_on_m - self._motion.footing.height_m
        if abs(drop_m) > _LOWEST_EDGE_M:
            self._drawn.positions[:, 2] -= drop_m
            self._mouth.teleport(self.mount("mouth").position)
            self._footsteps.teleport(self._surface)

    def _pose_bones(self) -> None:
        """Compute joint angles and bone poses of the present position."""
        motion = self._motion
        surface_m = motion.footing.height_m
        self._angles[:] = self._bone_poses.write(
            motion.stance, motion.ground, motion.yaw_rad, surface_m
        )
        self._posed_on_m = surface_m

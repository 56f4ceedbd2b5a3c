"""The joint-level body: 47 bones on 82 hinges that physics moves and motors drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action, checked_action
from veca_marl.sim.body.anatomy.skeleton import Underside, forward_kinematics
from veca_marl.sim.body.anatomy.urdf import Build
from veca_marl.sim.body.base import BodyCfg
from veca_marl.sim.body.figure import Figure
from veca_marl.sim.body.humanoid.articulation import Articulation, damping_number
from veca_marl.sim.body.humanoid.foresight import foreseen_angles
from veca_marl.sim.body.humanoid.joint_controls import (
    JOINT_ACTIONS,
    REACH_RAD,
    JointActionKind,
    JointChoice,
    Springs,
    chosen_joints,
)
from veca_marl.sim.body.humanoid.postures import (
    STANDING,
    Posture,
    check_angles,
    pelvis_rotation,
    posture_angles,
    varied,
)
from veca_marl.sim.body.voice import voice_spec
from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.geometry.rotations import heading_rad
from veca_marl.sim.physics.world import World
from veca_marl.sim.spec import continuous_spec

JOINTS = "joints"  # the part of the action that moves

_WAITING_ROOM_M = 100.0
_ARMS_OUT = Posture(0.0, {"upper_arm.abduction": 30.0})


class Detail(Enum):
    """Level of detail: with all fingers, or with straight fingers that are one with the hand."""

    full = "full"
    mitten = "mitten"


@dataclass
class HumanoidCfg(BodyCfg):
    """Numbers of the joint-level body.

    Attributes:
        detail: `full` moves 82 joints, `mitten` 40 at a little over half the cost. Actions, senses
            and names are the same: the mitten ignores what is asked of its fingers.
        action: Normalised torques, angles to go to, or how far these angles go on.
        joints: Which joints an action row moves: all 82, or the 40 of the limbs without fingers.
        strength: Share of the torques in the table of joints.
        friction: Lateral friction of the skin.
    """

    detail: Detail = Detail.full
    action: JointActionKind = JointActionKind.torque
    joints: JointChoice = JointChoice.all
    strength: float = 1.0
    friction: float = 0.8

    def __post_init__(self) -> None:
        """Refuse what is no choice."""
        super().__post_init__()
        self._check_choices(detail=Detail, action=JointActionKind, joints=JointChoice)
        if not 0.0 < self.strength <= 1.0:
            raise ValueError(f"body.strength={self.strength} must be above 0 and at most 1")


class Humanoid(Figure):
    """A body that is moved by its joints. See `Body` for what every body offers.

    Raises:
        ValueError: If the world's physics steps are too long for the body's damping.
    """

    def __init__(self, name: str, cfg: HumanoidCfg, world: World, shirt: int = 0) -> None:
        super().__init__(name, cfg.eye_range_deg, world, shirt)
        self.cfg = cfg
        build = Build(cfg.detail is Detail.full, strength=cfg.strength, friction=cfg.friction)
        self.articulation = Articulation(world.client, self._skeleton, build)
        self._refuse_long_steps(world.clock.substep_s)
        self._control, self._rows = JOINT_ACTIONS[cfg.action]
        self._chosen = np.array(chosen_joints(self._skeleton, cfg.joints))
        joints = continuous_spec(tuple(self.joint_names[joint] for joint in self._chosen))
        self.action_spec = {JOINTS: joints, **voice_spec(cfg.voice)}
        self._low = np.array([joint.low_rad for joint in self._skeleton.joints])
        self._high = np.array([joint.high_rad for joint in self._skeleton.joints])
        # of what does not move there is neither angle nor torque
        self._moving = np.isin(np.arange(len(self._low)), self.articulation.moving)
        self._angles, self._speeds = self.articulation.angles, self.articulation.speeds
        self._wishes = np.zeros(len(self._low))
        self._underside = Underside(self._skeleton, self.bone_names, skin=True)
        self._finite = True
        world.attach(self)
        world.after_substep.append(self._after_substep)
        # Bullet mixes up the contacts of saved states in which bodies meet, or parts of one body:
        # until the first reset each waits far outside by itself, arms off the thighs
        self.place((_WAITING_ROOM_M, 3.0 * len(world.movers), 0.0), 0.0, _ARMS_OUT)

    # ---- where it is

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: velocity of the pelvis in the world frame."""
        return self._pelvis_velocity.copy()

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector the trunk faces.

        It is the pelvis's forward axis turned upright the shortest way about a horizontal axis,
        so it stays defined on back and belly; on the back it points from head to feet.
        """
        yaw = heading_rad(self._drawn.rotations[0])
        return np.array([math.cos(yaw), math.sin(yaw), 0.0])

    @property
    def is_finite(self) -> bool:
        """Whether all its numbers have been finite.

        If not, it stays as it last was: Bullet's collision detection does not recover from such
        numbers, whatever is restored, so the world must be built anew.
        """
        return self._finite

    def place(
        self,
        position: Floats | tuple[float, float, float],
        yaw_rad: float = 0.0,
        posture: Posture | Floats = STANDING,
    ) -> None:
        """Start anew, at rest.

        Args:
            position: ``(3,)`` metres: the pelvis is above ``(x, y)``, the lowest point of the skin
                at height ``z``.
            yaw_rad: Turn about the vertical.
            posture: A posture, or ``(82,)`` joint angles (rad) of an upright body.

        Raises:
            ValueError: If a number is not finite or a joint cannot be at its angle.
        """
        place = np.array(position, np.float64)
        if place.shape != (3,) or not (np.isfinite(place).all() and math.isfinite(yaw_rad)):
            raise ValueError(f"{self.name}: cannot be at {position!r}, turned by {yaw_rad!r} rad")
        attitude = posture if isinstance(posture, Posture) else STANDING
        angles = self._checked(posture) * self._moving
        positions, rotations = self._frames()
        positions[0], rotations[0] = place, pelvis_rotation(attitude, yaw_rad)
        forward_kinematics(self._skeleton, angles, positions, rotations)
        positions[:, 2] += place[2] - self._underside.lowest_m(positions, rotations)
        self.articulation.place(Pose(positions[0].copy(), rotations[0].copy()), angles)
        self._start_anew()

    def _checked(self, posture: Posture | Floats) -> Floats:
        if isinstance(posture, Posture):
            return posture_angles(self._skeleton, posture)
        angles = np.asarray(posture, np.float64)
        if angles.shape != self._low.shape:
            raise ValueError(f"{self.name}: angles {angles.shape}, not {self._low.shape}")
        check_angles(self._skeleton, angles)
        return angles

    # ---- what it can do

    def _move(self, parts: Action) -> None:
        row = np.asarray(parts[JOINTS], np.float64)
        self._wishes[self._chosen] = self._rows.heed(row, self._wishes[self._chosen])

    def apply_torque(self, normalised: Floats) -> None:
        """Drive all 82 joints by shares of their strength in [-1, 1] (the paper's API).

        Raises:
            ValueError: If this body is commanded by angles or by fewer joints, if the array has
                another shape, or if a number is outside [-1, 1].
        """
        if self.cfg.action is not JointActionKind.torque or self.cfg.joints is not JointChoice.all:
            raise ValueError(
                f"{self.name}: apply_torque needs body.action=torque and body.joints=all"
            )
        spec = {JOINTS: self.action_spec[JOINTS]}
        self._move(checked_action(spec, {JOINTS: normalised}))

    def rest(self) -> None:
        """Try to keep all joints where they are."""
        self.act(self.encode(self.joint_angles()))

    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action that takes the joints nearest to ``(82,)`` angles (rad).

        It asks a position-controlled body for these angles; to a torque-controlled one it gives
        the torques that the position control would give at the end of the agent step: those that
        it would give now shake the body, for they hold for the whole step. A command of `Springs`
        gives this time itself, and may hold a call.
        """
        calm = self._world.clock.step_s
        springs = command if isinstance(command, Springs) else Springs(np.asarray(command), calm)
        targets = np.clip(springs.targets, self._low, self._high)
        angles = self.foresee(targets, springs.ahead_s)
        wishes = self._control.wishes(targets, angles, self._low, self._high)
        row = self._rows.towards(wishes[self._chosen], self._wishes[self._chosen])
        return self._with_voice({JOINTS: row.astype(np.float32)}, springs.call)

    def foresee(self, targets: Floats, ahead_s: float | None = None) -> Floats:
        """Return the ``(82,)`` angles (rad) a while after springs begin to pull to targets.

        The springs are those of the position control; contacts and weight are left out.

        Args:
            targets: ``(82,)`` rad.
            ahead_s: How long after; one agent step if nothing is said.
        """
        if ahead_s is None:
            ahead_s = self._world.clock.step_s
        stiffness = self.articulation.strengths_nm / REACH_RAD
        return foreseen_angles(self.articulation, targets, stiffness, ahead_s)

    def angles_of(self, posture: Posture) -> Floats:
        """Return the ``(82,)`` joint angles of a posture, rad: what `encode` takes."""
        return posture_angles(self._skeleton, posture)

    def vary(self, posture: Posture, spread_deg: float, rng: np.random.Generator) -> Posture:
        """Return a posture with every joint a little elsewhere, see `postures.varied`."""
        return varied(self._skeleton, posture, spread_deg, rng)

    # ---- the world moves it

    def reset(self) -> None:
        """Stand at the origin, relaxed and silent. The task usually puts it elsewhere."""
        self.place((0.0, 0.0, 0.0))

    def before_step(self) -> None:
        """Nothing to look for: physics finds what it meets."""

    def before_substep(self, substep_s: float) -> None:
        """Apply the torques of one physics step."""
        if not self._finite:
            return
        shares = self._control.shares(self._wishes, self._angles, self._low, self._high)
        np.multiply(shares, self._moving, out=self._shares)
        self.articulation.apply(self._shares * self.articulation.strengths_nm)

    def mirror(self) -> None:
        """Draw the bones where physics has them."""
        self._pose_bones()
        self._mouth.position = self.mount("mouth").position

    def _after_substep(self) -> None:
        if self._finite and self.articulation.read():
            self.articulation.hold_limits()
        else:
            self._finite = False

    def _start_anew(self) -> None:
        self._relax_eyes()
        self._shares[:] = 0.0
        self._finite = self._finite and self.articulation.read()
        staying = self._control.wishes(self._angles, self._angles, self._low, self._high)
        self._wishes[:] = self._rows.start(staying)
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    def _pose_bones(self) -> None:
        motion = self.articulation.motion()
        numbers = (motion.pose.position, motion.pose.rotation, *motion[1:])
        self._finite = self._finite and all(np.isfinite(part).all() for part in numbers)
        if not self._finite:
            return
        positions, rotations = self._frames()
        positions[0], rotations[0] = motion.pose
        self._pelvis_velocity[:], self._pelvis_spin[:] = motion[1:]
        forward_kinematics(self._skeleton, self._angles, positions, rotations)

    def _refuse_long_steps(self, substep_s: float) -> None:
        number = damping_number(self.articulation, substep_s)
        if number > 1.0:
            raise ValueError(
                f"{self.name}: physics steps of {substep_s * 1e3:.1f} ms are too long for its "
                f"joints' damping; at most {substep_s / number * 1e3:.1f} ms: raise clock.substeps"
            )

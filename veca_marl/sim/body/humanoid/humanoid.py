"""The joint-level body and its parameters: 47 bones on 82 hinges, driven by joint torques.

A torque command is constant for one agent step (40 ms). A proportional controller as stiff as the
joints are strong, evaluated with the angles at the start of the step, is unstable; evaluated with
the predicted angles at its end it is stable at any stiffness: "stable PD control", Tan, Liu & Turk
2011, IEEE Computer Graphics and Applications 31(4). The prediction contains weight and contact
forces: without them the stiffness at rest would be K / (1 + h K / D) instead of K, with stiffness
K, damping D and horizon h; that is a fourth of K for a horizon of one agent step.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action, checked_action
from veca_marl.sim.body.anatomy import Build, Underside, forward_kinematics
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.humanoid.articulation import Articulation
from veca_marl.sim.body.humanoid.joint_control import (
    JOINT_ACTIONS,
    SATURATION_RAD,
    JointActionKind,
    JointChoice,
    JointCommand,
    chosen_joints,
)
from veca_marl.sim.body.humanoid.postures import (
    STANDING,
    Posture,
    check_angles,
    pelvis_rotation,
    perturbed,
    posture_angles,
)
from veca_marl.sim.geometry import Floats, Pose, heading_rad
from veca_marl.sim.physics import World, is_contact
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.sense import ArraySpec, continuous_spec

_EYE_HEIGHT_M = 0.005  # least height of an eye above the floor


class Detail(Enum):
    """Level of detail: with all fingers, or with straight fingers fixed to the hands."""

    full = "full"
    mitten = "mitten"


@dataclass
class HumanoidCfg(BodyCfg):
    """Parameters of the joint-level body.

    Attributes:
        detail: `full` moves 82 joints; `mitten`, a body with fixed fingers, moves 40, and an agent
            step takes half to two thirds of the time. Actions, senses and names are the same: a
            `mitten` ignores the actions of its fingers.
        action: Normalised torques, target angles, or increments of target angles.
        joints: Which joints the action moves: all 82, the 40 that are not in fingers, or the 14 of
            both arms.
        strength: Fraction of the torques in the table of joints, above 0 and at most 1.
        friction: Lateral friction of the skin.
    """

    detail: Detail = Detail.full
    action: JointActionKind = JointActionKind.torque
    joints: JointChoice = JointChoice.all
    strength: float = 1.0
    friction: float = 0.8

    def __post_init__(self) -> None:
        """Check the choices and the numbers."""
        super().__post_init__()
        self._check_choices(detail=Detail, action=JointActionKind, joints=JointChoice)
        if not 0.0 < self.strength <= 1.0:
            raise ValueError(f"body.strength={self.strength} must be above 0 and at most 1")


def predicted_angles(
    body: Articulation, targets: Floats, stiffness: Floats, horizon_s: float
) -> Floats:
    """Return the joint angles ``(82,)``, rad, after springs have acted.

    Weight and contact forces are those that are predicted for the next physics step.

    Args:
        body: The body, with the state of the last `read`.
        targets: ``(82,)`` rad, the rest angles of the springs.
        stiffness: ``(82,)`` N m/rad.
        horizon_s: Duration.
    """
    moving = body.moving
    spring, damping, speeds = stiffness[moving], body.damping[moving], body.speeds[moving]
    stretch = targets[moving] - body.angles[moving] - horizon_s * speeds
    forces = body.dynamics.forces.predicted - body.dynamics.state.bias
    forces[6:] += spring * stretch - damping * speeds
    resistance = horizon_s * damping + horizon_s**2 * spring
    accelerations = body.dynamics.solve_with(resistance, forces)[6:]
    angles = body.angles.copy()
    angles[moving] += horizon_s * speeds + horizon_s**2 * accelerations
    return angles


def self_contacts(
    client: BulletClient, body_id: int, bones: Mapping[int, str]
) -> set[tuple[str, str]]:
    """Return the pairs of bones that touched each other in the last physics step.

    Args:
        client: The PyBullet client.
        body_id: Bullet's id of the body.
        bones: Bone of each link that has a collider.

    Returns:
        Each pair in the order of their names.
    """
    points = client.getContactPoints(body_id, body_id)
    pairs = [(bones[p.link_a], bones[p.link_b]) for p in points if is_contact(p)]
    return {(min(pair), max(pair)) for pair in pairs}


JOINTS = "joints"  # the part of the action that moves

# physics step up to which contacts of light limbs have been found stable; joint damping is implicit
LONGEST_STEP_S = 0.010
# With 10 iterations the contact velocities of a body on its hands are not 0 after a physics step:
# the hands of one that holds target angles slide together at 16 mm/s until it falls. `mitten`
# bodies and those under torque control have the iterations of the clock.
HOLDING_ITERATIONS = 20
# distance from their limits at which joints are stopped
LIMIT_MARGIN_RAD = 1e-4
# The same for `mitten` bodies that hold target angles. On all fours contacts push the wrists
# outward by 0.005 to 0.01 rad per physics step. Beyond the limit their angles would be clipped,
# which moves the palms inward against friction. With this margin fingers vibrate, and the gait of
# torque-driven bodies moves them backwards less.
HOLDING_MARGIN_RAD = 0.02
_UNPLACED_M = 100.0  # distance from the origin at which bodies are before the first reset
_ARMS_OUT = Posture(0.0, {"upper_arm.abduction": 30.0})


class Humanoid(Body):
    """A body that is moved by its joints. See `Body` for the common methods.

    Attributes:
        articulation: Its bones in Bullet.

    Raises:
        ValueError: If the world's physics steps are longer than `LONGEST_STEP_S`.
    """

    cfg_type: ClassVar[type[BodyCfg]] = HumanoidCfg

    def __init__(self, name: str, cfg: HumanoidCfg, world: World, shirt: int = 0) -> None:
        super().__init__(name, cfg, world, shirt)
        self.cfg = cfg
        _check_substep(name, world.clock.substep_s)
        build = Build(cfg.detail is Detail.full, strength=cfg.strength, friction=cfg.friction)
        if cfg.detail is Detail.full and cfg.action is not JointActionKind.torque:
            world.require_solver_iterations(HOLDING_ITERATIONS)
        margin_rad = _limit_margin_rad(cfg)
        self.articulation = Articulation(world.client, self._skeleton, build, margin_rad)
        self._control, self._update = JOINT_ACTIONS[cfg.action]
        self._chosen = np.array(chosen_joints(self._skeleton, cfg.joints))
        self._low = np.array([joint.low_rad for joint in self._skeleton.joints])
        self._high = np.array([joint.high_rad for joint in self._skeleton.joints])
        # fixed joints have neither angle nor torque
        self._moving = np.isin(np.arange(len(self._low)), self.articulation.moving)
        self._angles, self._speeds = self.articulation.angles, self.articulation.speeds
        self._set_points = np.zeros(len(self._low))
        self._underside = Underside(self._skeleton, self.bone_names, skin=True)
        self._finite = True
        world.attach(self)
        # Bullet restores the contacts of a saved state wrongly if bodies, or parts of one body,
        # touch in it: until the first reset each is far from all others, arms off the thighs
        self.place((_UNPLACED_M, 3.0 * len(world.movers), 0.0), 0.0, _ARMS_OUT)

    def _movement_spec(self, cfg: HumanoidCfg) -> dict[str, ArraySpec]:
        joints = chosen_joints(self._skeleton, cfg.joints)
        return {JOINTS: continuous_spec(tuple(self.joint_names[joint] for joint in joints))}

    # ---- position, velocity and strength

    @property
    def body_id(self) -> int:
        """PyBullet's id of the articulated bones."""
        return self.articulation.body_id

    @property
    def obstacle_ids(self) -> tuple[int, ...]:
        """The id of the articulated bones."""
        return (self.body_id,)

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s: velocity of the pelvis in the world frame."""
        return self._pelvis_velocity.copy()

    @property
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector that the trunk faces.

        It is the pelvis's forward axis after the shortest rotation about a horizontal axis that
        makes the pelvis upright, so it is defined for all attitudes; of a body that lies on its
        back it points from head to feet.
        """
        yaw = heading_rad(self._drawn.rotations[0])
        return np.array([math.cos(yaw), math.sin(yaw), 0.0])

    @property
    def is_finite(self) -> bool:
        """Whether its numbers have been finite, and in the range of motions, since it was built.

        If not, its state is no longer updated: Bullet's collision detection does not recover from
        numbers that are not finite, whatever is restored, so the world must be rebuilt. Positions
        of 1e6 m, and speeds that Bullet cuts (1000 m/s, 1000 rad/s), are beyond any motion.
        """
        return self._finite

    @property
    def action_kind(self) -> JointActionKind:
        """How the joints are commanded."""
        return self.cfg.action

    @property
    def joint_strengths_nm(self) -> Floats:
        """``(82,)`` N m: the greatest torque of each joint; 0 for fixed joints."""
        return self.articulation.strengths_nm.copy()

    def place(
        self,
        position: Floats | tuple[float, float, float],
        yaw_rad: float = 0.0,
        posture: Posture | Floats = STANDING,
    ) -> None:
        """Start at a place in a posture, at rest.

        Args:
            position: ``(3,)`` metres: the pelvis is above ``(x, y)``, the lowest point of the skin
                at height ``z``.
            yaw_rad: Rotation about the vertical.
            posture: A posture, or ``(82,)`` joint angles (rad) of an upright body.

        Raises:
            ValueError: If a number is not finite or an angle is outside the limits of its joint.
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
        self._start()

    def _kept_eye(self, eye: Pose, to_other_m: float) -> Pose:
        """Return the pose of an eye, raised if one of both is below the floor or too near to it.

        Eyes are up to 12 mm in front of what the head collides with, and contacts give way. Both
        are raised alike, so that their distance from each other stays what it is.
        """
        height_m = float(eye.position[2])
        other_m = height_m + to_other_m * float(eye.rotation[2, 1])
        missing_m = _EYE_HEIGHT_M - min(height_m, other_m)
        if missing_m <= 0.0:
            return eye
        return Pose(eye.position + np.array([0.0, 0.0, missing_m]), eye.rotation)

    def _checked(self, posture: Posture | Floats) -> Floats:
        if isinstance(posture, Posture):
            return posture_angles(self._skeleton, posture)
        angles = np.asarray(posture, np.float64)
        if angles.shape != self._low.shape:
            raise ValueError(f"{self.name}: angles {angles.shape}, not {self._low.shape}")
        check_angles(self._skeleton, angles)
        return angles

    def self_contacts(self) -> set[tuple[str, str]]:
        """Return the pairs of its bones that touched each other in the last physics step.

        Names are in alphabetical order. Bones of one limb do not collide, nor do upper arms and
        thighs with the trunk.
        """
        return self_contacts(self._world.client, self.body_id, self.articulation.bones_of_links)

    def state(self) -> dict[str, Floats]:
        """See `Body`; also ``angles`` and ``speeds`` of all joints, ``(82,)`` each."""
        angles, speeds = self.joint_angles(), self.joint_velocities()
        return {**super().state(), "angles": angles, "speeds": speeds}

    # ---- commands

    def _move(self, parts: Action) -> None:
        action = np.asarray(parts[JOINTS], np.float64)
        self._set_points[self._chosen] = self._update.apply(action, self._set_points[self._chosen])

    def apply_torque(self, normalised: Floats) -> None:
        """Drive all 82 joints by normalised torques in [-1, 1] (the paper's API).

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
        """Command all joints to hold their angles; no call is chosen."""
        self._move(self.encode(self.joint_angles()))

    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action that moves the joints toward target angles.

        For a position-controlled body the targets are the set-points. For a torque-controlled one
        the action is the torques of the position control at the end of the agent step; those at
        its start, held for the whole step, would make the body oscillate.

        Args:
            command: ``(82,)`` rad, or a `JointCommand`, which may also hold a call.
        """
        if not isinstance(command, JointCommand):
            command = JointCommand(np.asarray(command), self._world.clock.step_s)
        targets = np.clip(command.targets, self._low, self._high)
        angles = self.predict_angles(targets, command.horizon_s)
        wanted = self._control.set_points(targets, angles, self._low, self._high)
        action = self._update.encode(wanted[self._chosen], self._set_points[self._chosen])
        return self._with_voice({JOINTS: action.astype(np.float32)}, command.call)

    def predict_angles(self, targets: Floats, horizon_s: float | None = None) -> Floats:
        """Return the ``(82,)`` angles (rad) after the position control has acted for a while.

        Weight and contact forces are constant, see `predicted_angles`.

        Args:
            targets: ``(82,)`` rad.
            horizon_s: Duration; one agent step by default.
        """
        if horizon_s is None:
            horizon_s = self._world.clock.step_s
        stiffness = self.articulation.strengths_nm / SATURATION_RAD
        return predicted_angles(self.articulation, targets, stiffness, horizon_s)

    def posture_angles(self, posture: Posture) -> Floats:
        """Return the ``(82,)`` joint angles of a posture, rad; `encode` takes them."""
        return posture_angles(self._skeleton, posture)

    def perturb(self, posture: Posture, spread_deg: float, rng: np.random.Generator) -> Posture:
        """Return a posture with normally distributed deviations, see `postures.perturbed`."""
        return perturbed(self._skeleton, posture, spread_deg, rng)

    # ---- calls from the world, see `Mover`

    def before_step(self) -> None:
        """Read the gravity, which the physics steps of this agent step need."""
        self.articulation.read_gravity()

    def before_substep(self, substep_s: float) -> None:
        """Apply the torques of one physics step."""
        if not self._finite:
            return
        torques = self._control.torques(self._set_points, self._angles, self._low, self._high)
        np.multiply(torques, self._moving, out=self._torques)
        strengths = self.articulation.strengths_nm
        stiffness = self._control.stiffness(torques) * strengths
        self.articulation.apply(self._torques * strengths, stiffness, substep_s)

    def write_frames(self) -> None:
        """Write the poses of the bones and move the voice to the mouth."""
        self._pose_bones()
        self._mouth.position = self.mount("mouth").position

    def after_substep(self, substep_s: float) -> None:
        """Read the state, apply the limits of the joints and restore the momentum."""
        self._finite = self._finite and self.articulation.settle(substep_s)
        if self._finite:
            self.articulation.keep_apart(self._settled())

    def _settled(self) -> list[Articulation]:
        """Return the bones of the joint-level bodies that move before this one."""
        earlier = itertools.takewhile(lambda mover: mover is not self, self._world.movers)
        return [mover.articulation for mover in earlier if isinstance(mover, Humanoid)]

    def _start(self) -> None:
        """Begin at rest in the present pose."""
        self._gaze.relax()
        self._torques[:] = 0.0
        self._finite = self._finite and self.articulation.read()
        holding = self._control.set_points(self._angles, self._angles, self._low, self._high)
        self._set_points[:] = self._update.start(holding)
        self._pose_bones()
        self._mouth.teleport(self.mount("mouth").position)

    def _pose_bones(self) -> None:
        if not self._finite:
            return
        motion = self.articulation.motion()
        positions, rotations = self._frames()
        positions[0], rotations[0] = motion.pose
        self._pelvis_velocity[:], self._pelvis_spin[:] = motion[1:]
        forward_kinematics(self._skeleton, self._angles, positions, rotations)


def _check_substep(name: str, substep_s: float) -> None:
    """Raise `ValueError` if physics steps are too long for a joint-level body."""
    # a step of 40 ms in 4 parts is not above 10 ms
    if substep_s > LONGEST_STEP_S + 1e-9:
        raise ValueError(
            f"{name}: physics steps of {substep_s * 1e3:.1f} ms are too long for the contacts of a "
            f"joint-level body; at most {LONGEST_STEP_S * 1e3:.0f} ms: raise clock.substeps"
        )


def _limit_margin_rad(cfg: HumanoidCfg) -> float:
    """Return the distance from their limits at which the joints of a body are stopped, rad."""
    holds = cfg.action is not JointActionKind.torque
    return HOLDING_MARGIN_RAD if holds and cfg.detail is Detail.mitten else LIMIT_MARGIN_RAD

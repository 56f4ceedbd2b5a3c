"""The gait of a walker: joint angles from the phase of the stride, and a kick.

The gait is kinematic, not a simulation of forces. The trajectories of the feet are given and the
angles of the legs follow by inverse kinematics: the foot in stance does not slip on the floor, the
other swings forward, and the pelvis moves up and down as over an inverted pendulum. Feet land flat
and strides are short, as in children who have just learnt to walk. The trunk does not sway, so the
senses in the head are steady. Amplitudes are ours, chosen by eye within the ranges of motion of the
skeleton.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy import Growth, Skeleton
from veca_marl.sim.body.walker.neck import Neck
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel

_STANCE = 0.5  # fraction of the stride in which a foot is on the floor


class GaitCfg(NamedTuple):
    """Parameters of the gait of the body of 0.78 m; `of_size` gives those of another.

    Attributes:
        step_m: Distance that a foot in stance moves back relative to the hip at full stride.
        step_centre_m: Centre of this distance ahead of the hip: thighs flex more than they extend.
        full_stride_mps: Speed above which the stride gets faster but not longer.
        turning_m: Walking speed (m/s) whose stride is that of a turn on the spot at 1 rad/s.
        leg_m: Height of the hips above the ankles in standing.
        sink_m: Mean lowering of the pelvis at full stride.
        bob_m: Amplitude of its vertical oscillation, twice per stride.
        lift_m: Height of a foot in mid-swing at full stride.
        toe_rad: Plantar flexion in mid-swing.
        arm_swing_rad: Amplitude of the upper arm at full stride.
        elbow_rad: Flexion of the elbows.
        carry_arm_rad: Flexion of the right upper arm while it carries something.
        carry_elbow_rad: Flexion of the right elbow then.
        settle_s: Time constant with which the stride follows the speed.
        kick_s: Duration of a kick.
        blend_s: Time in which the legs go over to a kick, and from it.
    """

    step_m: float = 0.2
    step_centre_m: float = 0.005
    full_stride_mps: float = 0.6
    turning_m: float = 0.15
    leg_m: float = 0.286
    sink_m: float = 0.010
    bob_m: float = 0.008
    lift_m: float = 0.045
    toe_rad: float = 0.35
    arm_swing_rad: float = 0.5
    elbow_rad: float = 0.5
    carry_arm_rad: float = 0.35
    carry_elbow_rad: float = 1.2
    settle_s: float = 0.08
    kick_s: float = 0.36
    blend_s: float = 0.08

    def of_size(self, growth: Growth) -> GaitCfg:
        """Return the gait of a body of another size: lengths follow the legs, speeds their root."""
        leg = growth.leg
        return self._replace(
            step_m=self.step_m * leg,
            step_centre_m=self.step_centre_m * leg,
            full_stride_mps=self.full_stride_mps * growth.speed,
            turning_m=self.turning_m * leg,
            leg_m=self.leg_m * leg,
            sink_m=self.sink_m * leg,
            bob_m=self.bob_m * leg,
            lift_m=self.lift_m * leg,
        )


# the kicking leg: fraction of the kick, flexion of thigh and knee (rad); the strike comes first,
# because the ball leaves at once, then the follow-through
_KICK = np.array([[0.0, 0.5, 0.8], [0.2, 1.1, 0.15], [0.5, 1.0, 0.4], [1.0, 0.45, 0.7]])
_KICK_TOES_RAD = -0.4


class Legs(NamedTuple):
    """Where the joints of legs and arms are among all joints, and lengths; left before right.

    Attributes:
        thigh: Flexion of the thighs.
        abduct: Abduction of the thighs.
        twist: Internal rotation of the thighs.
        shank: Flexion of the shanks.
        foot: Dorsiflexion of the feet.
        ankle_roll: Inversion of the feet.
        arm: Flexion of the upper arms.
        elbow: Flexion of the forearms.
        hip_y_m: Distance of the hips to the left of the middle.
        thigh_m: Length of a thigh.
        shank_m: Length of a shank.
    """

    thigh: tuple[int, int]
    abduct: tuple[int, int]
    twist: tuple[int, int]
    shank: tuple[int, int]
    foot: tuple[int, int]
    ankle_roll: tuple[int, int]
    arm: tuple[int, int]
    elbow: tuple[int, int]
    hip_y_m: tuple[float, float]
    thigh_m: float
    shank_m: float


def measure_legs(skeleton: Skeleton) -> Legs:
    """Find the joints of legs and arms, the hips and the lengths of thigh and shank."""

    def both(bone: str, label: str) -> tuple[int, int]:
        return skeleton.joint(f"l_{bone}", label), skeleton.joint(f"r_{bone}", label)

    origins = skeleton.origins
    return Legs(
        thigh=both("thigh", "flexion"),
        abduct=both("thigh", "abduction"),
        twist=both("thigh", "internal_rotation"),
        shank=both("shank", "flexion"),
        foot=both("foot", "dorsiflexion"),
        ankle_roll=both("foot", "inversion"),
        arm=both("upper_arm", "flexion"),
        elbow=both("forearm", "flexion"),
        hip_y_m=(
            float(origins[skeleton.bone("l_thigh"), 1]),
            float(origins[skeleton.bone("r_thigh"), 1]),
        ),
        thigh_m=-float(origins[skeleton.bone("l_shank"), 2]),
        shank_m=-float(origins[skeleton.bone("l_foot"), 2]),
    )


class Stride(NamedTuple):
    """The state of a walk.

    Attributes:
        phase: Of the stride, in [0, 1).
        speed_mps: Forward speed, smoothed.
        turn_radps: Turning speed, smoothed.
        share: Length of the stride as a fraction of the full one.
        stance_s: Duration of the stance.
    """

    phase: float
    speed_mps: float
    turn_radps: float
    share: float
    stance_s: float


@kernel
def write_stride(angles: Floats, stride: Stride, cfg: GaitCfg, legs: Legs) -> None:
    """Write the angles of legs and arms, each arm in opposition to the leg of its side.

    Args:
        angles: ``(82,)`` rad.
        stride: The state of the walk.
        cfg: Parameters of the gait.
        legs: The joints.
    """
    for side in range(2):
        phase = (stride.phase + 0.5 * side) % 1.0
        # from 0.5 at touchdown to -0.5 at lift-off, and back during the swing
        along = 0.5 - phase / _STANCE
        lift = toes = 0.0
        if phase >= _STANCE:
            swing_phase = (phase - _STANCE) / (1.0 - _STANCE)
            along = -0.5 * math.cos(math.pi * swing_phase)
            height = stride.share * math.sin(math.pi * swing_phase)
            lift, toes = cfg.lift_m * height, -cfg.toe_rad * height
        x, y, yaw = _foothold(stride, cfg, legs.hip_y_m[side], -along * stride.stance_s)
        place_foot(angles, side, (x, y, yaw, lift, toes), stride, cfg, legs)
        arm_swing = cfg.arm_swing_rad * math.copysign(stride.share, stride.speed_mps)
        angles[legs.arm[side]] = -arm_swing * math.cos(2.0 * math.pi * phase)
        angles[legs.elbow[side]] = cfg.elbow_rad


@kernel
def _foothold(
    stride: Stride, cfg: GaitCfg, hip_y_m: float, time_s: float
) -> tuple[float, float, float]:
    """Return where a foot in stance is relative to its hip while the body moves on an arc.

    Args:
        stride: The state of the walk.
        cfg: Parameters of the gait.
        hip_y_m: Distance of the hip to the left of the middle.
        time_s: Time since the foot was below the hip.

    Returns:
        Forward and left of the hip, metres, and the yaw of the foot relative to the pelvis.
    """
    turned = stride.turn_radps * time_s
    distance_m = stride.speed_mps * time_s
    x = cfg.step_centre_m * stride.share - distance_m * math.cos(turned / 2.0)
    y = hip_y_m - distance_m * math.sin(turned / 2.0)
    c, s = math.cos(turned), math.sin(turned)
    return c * x + s * y, c * y - s * x - hip_y_m, -turned


@kernel
def place_foot(
    angles: Floats,
    side: int,
    foot: tuple[float, float, float, float, float],
    stride: Stride,
    cfg: GaitCfg,
    legs: Legs,
) -> None:
    """Write the angles of a leg by inverse kinematics of its ankle and the foot's yaw.

    The law of cosines gives the knee. The hip rotates about y, then x, then z; the rotation about z
    is given, and the other two follow one after the other.

    Args:
        angles: ``(82,)`` rad; those of the leg are changed.
        side: 0 is left, 1 is right.
        foot: Forward and left of the hip (metres), yaw relative to the pelvis (rad), height above
            the floor (metres), and dorsiflexion of the toes (rad).
        stride: The state of the walk.
        cfg: Parameters of the gait.
        legs: The joints.
    """
    x, y, yaw, lift_m, toes = foot
    bob = cfg.bob_m * math.cos(4.0 * math.pi * stride.phase)
    down_m = cfg.leg_m - stride.share * (cfg.sink_m + bob) - lift_m
    thigh_m, shank_m = legs.thigh_m, legs.shank_m
    reach = min(math.sqrt(x * x + y * y + down_m * down_m), thigh_m + shank_m)
    inside = (thigh_m**2 + shank_m**2 - reach**2) / (2.0 * thigh_m * shank_m)
    knee = math.pi - math.acos(max(inside, -1.0))
    back, below = shank_m * math.sin(knee), thigh_m + shank_m * math.cos(knee)
    aside = -back * math.sin(yaw)
    roll = math.asin(y / math.hypot(aside, below)) - math.atan2(aside, below)
    below = below * math.cos(roll) - aside * math.sin(roll)
    thigh = math.atan2(x, down_m) + math.atan2(back * math.cos(yaw), below)
    outward = 1.0 if side == 0 else -1.0
    angles[legs.thigh[side]] = thigh
    angles[legs.abduct[side]] = outward * roll
    angles[legs.twist[side]] = -outward * yaw
    angles[legs.shank[side]] = knee
    angles[legs.foot[side]] = toes - (thigh - knee)
    angles[legs.ankle_roll[side]] = outward * roll


class Gait:
    """Computes the 82 joint angles of a walking child from its speeds and the time.

    Args:
        skeleton: The table of bones and joints.
        cfg: Parameters; the defaults, for the size of the skeleton, if None.

    Attributes:
        phase: Of the stride, in [0, 1).
        angles: ``(82,)`` rad, as of the last `pose`.
        landings_s: When feet landed in the last `advance`, from its beginning.
        carrying: Whether the right hand is held in front of the body.
    """

    def __init__(self, skeleton: Skeleton, cfg: GaitCfg | None = None) -> None:
        self.cfg = cfg or GaitCfg().of_size(skeleton.growth)
        self._legs = measure_legs(skeleton)
        self._neck = Neck(skeleton)
        self._low = np.array([j.low_rad for j in skeleton.joints])
        self._high = np.array([j.high_rad for j in skeleton.joints])
        self.angles: Floats = np.zeros(len(skeleton.joints))
        self.reset()

    def reset(self) -> None:
        """Stand still with empty hands."""
        self.carrying = False
        self.phase = 0.0
        self.landings_s: list[float] = []
        self._speed_mps = self._turn_radps = 0.0
        self._kick_left_s = self._blend_left_s = 0.0
        self._blended = self.angles

    def kick(self) -> None:
        """Start a kick with the right leg."""
        self._kick_left_s = self.cfg.kick_s
        self._blend()

    def _blend(self) -> None:
        """Go over from the present pose to another motion within `blend_s`."""
        self._blended, self._blend_left_s = self.angles.copy(), self.cfg.blend_s

    def advance(self, speed_mps: float, turn_radps: float, step_s: float) -> None:
        """Advance the stride by one step; turning on the spot needs strides as well.

        Args:
            speed_mps: Forward speed, negative when walking backward.
            turn_radps: Turning speed, left is positive.
            step_s: Time step.
        """
        follow = 1.0 - math.exp(-step_s / self.cfg.settle_s)
        self._speed_mps += follow * (speed_mps - self._speed_mps)
        self._turn_radps += follow * (turn_radps - self._turn_radps)
        phase_per_s = _STANCE / self._stance_s()
        before, after = self.phase, self.phase + phase_per_s * step_s
        # one foot lands at the phase 0, the other one half a stride later
        landings = range(math.floor(before / _STANCE) + 1, math.floor(after / _STANCE) + 1)
        self.landings_s = [(_STANCE * landing - before) / phase_per_s for landing in landings]
        self.phase = after % 1.0
        self._blend_left_s = max(0.0, self._blend_left_s - step_s)
        if self._kick_left_s > 0.0:
            self._kick_left_s -= step_s
            self.phase = 0.5  # the kicking foot is about to land
            if self._kick_left_s <= 0.0:
                self._blend()

    def pose(self, head_pitch_rad: float, head_yaw_rad: float) -> Floats:
        """Compute and return the ``(82,)`` joint angles of the present phase."""
        if self._kick_left_s > 0.0:
            standing = self.cfg.step_centre_m, 0.0, 0.0, 0.0, 0.0
            place_foot(self.angles, 0, standing, self._stride, self.cfg, self._legs)
            self._swing_kicking_leg()
        else:
            write_stride(self.angles, self._stride, self.cfg, self._legs)
        if self.carrying:
            self.angles[self._legs.arm[1]] = self.cfg.carry_arm_rad
            self.angles[self._legs.elbow[1]] = self.cfg.carry_elbow_rad
        if self._blend_left_s > 0.0:
            self.angles += self._blend_left_s / self.cfg.blend_s * (self._blended - self.angles)
        self._neck.turn(self.angles, head_pitch_rad, head_yaw_rad, level_rad=0.0)
        clip(self.angles, self._low, self._high)
        return self.angles

    @property
    def _stride(self) -> Stride:
        pace = self._speed_mps, self._turn_radps
        return Stride(self.phase, *pace, self.share, self._stance_s())

    def _pace_mps(self) -> float:
        return abs(self._speed_mps) + self.cfg.turning_m * abs(self._turn_radps)

    @property
    def share(self) -> float:
        """Length of the stride as a fraction of the full one."""
        return min(1.0, self._pace_mps() / self.cfg.full_stride_mps)

    @property
    def landing_mps(self) -> float:
        """Vertical speed of a foot at the end of its swing."""
        return math.pi * self.cfg.lift_m * self.share / self._stance_s()

    def _stance_s(self) -> float:
        """Return the duration of the stance."""
        return self.cfg.step_m / max(self._pace_mps(), self.cfg.full_stride_mps)

    def _swing_kicking_leg(self) -> None:
        done = 1.0 - self._kick_left_s / self.cfg.kick_s
        self.angles[self._legs.thigh[1]] = np.interp(done, _KICK[:, 0], _KICK[:, 1])
        self.angles[self._legs.shank[1]] = np.interp(done, _KICK[:, 0], _KICK[:, 2])
        self.angles[self._legs.foot[1]] = _KICK_TOES_RAD * (1.0 - done)


@kernel
def clip(angles: Floats, low: Floats, high: Floats) -> None:
    """Clip angles ``(n,)`` to their limits ``(n,)`` in place."""
    for i in range(len(angles)):
        angles[i] = min(max(angles[i], low[i]), high[i])

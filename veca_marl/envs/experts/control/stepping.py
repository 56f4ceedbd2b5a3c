"""Stepping: a periodic gait on two feet with feedback from the balance of the trunk.

Position and velocity of the trunk relative to the feet act on the angles of the loaded and of the
lifted leg, as in Yin, Loken & van de Panne 2007, "SIMBICON: simple biped locomotion control". Which
way a gain acts is not prescribed: signs and sizes are what a search found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.geometry import Floats

_SIDES = (("l_", 1.0, 0.0), ("r_", -1.0, math.pi))  # prefix, sign of the outward direction, phase
_PELVIS_SHARE = 0.45  # of the middle of the trunk between pelvis and chest


@dataclass(frozen=True)
class SteppingPattern:
    """Parameters of the gait; angles are in degrees, beyond the limits of a joint they are clipped.

    A standing posture with its feedback was found first, then steps in place, then steps forwards,
    each by covariance matrix adaptation (Hansen 2016, "The CMA evolution strategy: a tutorial")
    over 2 to 4 starts drawn for each generation, on the body `mitten_limbs`.

    Attributes:
        frequency_hz: Pairs of steps per second.
        ramp_s: Time in which the amplitudes grow from 0.
        horizon: Horizon of the position control, in agent steps; see `JointCommand`.
        lift_lead_rad: Lead of the lifts of the feet before the swings.
        loaded: Share of the feedback that a lifted leg keeps.
        lead_m: Set-point of the trunk ahead of the feet.
        speed_mps: Set-point of the speed.
        spine: Flexion of the spine.
        spine_sway: Amplitude and phase (rad) of its lateral bend.
        hip: Flexion of the hips at rest.
        hip_pitch: Gains of a hip per radian of the chest's pitch, and per radian per second.
        hip_balance: Gains per metre of lead and per metre per second.
        hip_swing: Amplitude and phase (rad).
        hip_lift: Flexion of a lifted leg.
        hip_catch: Gains of a lifted leg, as `hip_balance`.
        knee: Flexion of the knees at rest.
        knee_lift: Flexion of a lifted leg.
        ankle: Dorsiflexion of the feet at rest.
        ankle_balance: Gains, as `hip_balance`.
        ankle_swing: Amplitude and phase (rad).
        ankle_lift: Dorsiflexion of a lifted foot.
        abduction: Abduction of the hips at rest.
        abduction_balance: Gains per metre beside the feet and per metre per second, outwards.
        abduction_swing: Amplitude and phase (rad).
        abduction_catch: Gains of a lifted leg, as `abduction_balance`.
        inversion: Inversion of the feet at rest.
        inversion_balance: Gains, as `abduction_balance`.
        inversion_swing: Amplitude and phase (rad).
        yaw: Gains of the inward rotation of the hips per radian of yaw to the left, and per radian
            per second.
        arm: Flexion of the upper arms at rest.
        arm_swing: Amplitude of their swing against the legs.
        arm_abduction: Abduction of the upper arms.
        elbow: Flexion of the elbows.
    """

    frequency_hz: float = 3.569
    ramp_s: float = 0.43
    horizon: float = 0.95
    lift_lead_rad: float = 2.34
    loaded: float = 0.81
    lead_m: float = -0.076
    speed_mps: float = 0.614
    spine: float = -0.36
    spine_sway: tuple[float, float] = (-20.22, 2.81)
    hip: float = -13.79
    hip_pitch: tuple[float, float] = (-59.63, 5.67)
    hip_balance: tuple[float, float] = (-151.87, 38.17)
    hip_swing: tuple[float, float] = (-20.79, 3.22)
    hip_lift: float = -33.55
    hip_catch: tuple[float, float] = (-35.77, -35.24)
    knee: float = -24.46
    knee_lift: float = 54.84
    ankle: float = 17.92
    ankle_balance: tuple[float, float] = (-438.98, -126.19)
    ankle_swing: tuple[float, float] = (-2.93, 1.36)
    ankle_lift: float = -19.1
    abduction: float = 2.07
    abduction_balance: tuple[float, float] = (-67.64, 19.16)
    abduction_swing: tuple[float, float] = (16.43, 0.84)
    abduction_catch: tuple[float, float] = (28.71, 63.3)
    inversion: float = -4.78
    inversion_balance: tuple[float, float] = (266.7, -46.51)
    inversion_swing: tuple[float, float] = (-14.54, 3.16)
    yaw: tuple[float, float] = (11.11, -16.78)
    arm: float = -33.03
    arm_swing: float = 61.75
    arm_abduction: float = 30.85
    elbow: float = -14.57


class Balance(NamedTuple):
    """Deviations of the trunk from its set-points; each is a value and its rate.

    Attributes:
        ahead: Trunk ahead of the middle of the feet, m, and its speed forwards, m/s.
        left: Trunk to the left of the middle of the feet, m, and its speed to the left, m/s.
        pitch: Pitch of the chest, forwards, rad and rad/s.
        yaw: Rotation of the pelvis to the left, rad and rad/s.
    """

    ahead: tuple[float, float]
    left: tuple[float, float]
    pitch: tuple[float, float]
    yaw: tuple[float, float]


class Stepping:
    """Target angles that step forwards along the heading at the start, until the body falls.

    Args:
        body: The body; it stands upright when the skill is reset.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s, self._pattern = body, step_s, SteppingPattern()
        self._index = {name: index for index, name in enumerate(body.joint_names)}
        self.reset()

    def reset(self) -> None:
        """Start with the left leg, in the direction that the body faces."""
        self._forward = self._body.forward
        self._left = np.array([-self._forward[1], self._forward[0], 0.0])
        self._time_s = 0.0
        self._angles: Floats | None = None  # pitch and yaw in the step before

    def follow_body(self) -> None:
        """See `Expert.follow_body`; the clock is kept: it lasts for two or three steps only."""

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        p, balance = self._pattern, self._balance()
        phase = 2.0 * math.pi * p.frequency_hz * self._time_s
        growth = min(1.0, self._time_s / p.ramp_s)
        self._time_s += self._step_s
        degrees = np.zeros(len(self._index))
        degrees[self._index["spine.flexion"]] = p.spine
        degrees[self._index["spine.lateral"]] = growth * _wave(p.spine_sway, phase)
        for side, outward, shift in _SIDES:
            limbs = leg(p, balance, outward, phase + shift, growth) | arm(p, phase + shift, growth)
            for name, angle in limbs.items():
                degrees[self._index[side + name]] = angle
        return JointCommand(np.radians(degrees), p.horizon * self._step_s)

    def _balance(self) -> Balance:
        body, p = self._body, self._pattern
        chest, pelvis = body.bone("chest"), body.bone("pelvis")
        feet = 0.5 * (body.bone("l_foot").position + body.bone("r_foot").position)
        trunk = _PELVIS_SHARE * pelvis.position + (1.0 - _PELVIS_SHARE) * chest.position
        away, velocity = trunk - feet, body.velocity
        pitch = math.atan2(chest.up @ self._forward, chest.up[2])
        yaw = math.atan2(pelvis.forward @ self._left, pelvis.forward @ self._forward)
        angles = np.array([pitch, yaw])
        rates = np.zeros(2) if self._angles is None else (angles - self._angles) / self._step_s
        self._angles = angles
        ahead, left = away @ self._forward - p.lead_m, away @ self._left
        speed, drift = velocity @ self._forward - p.speed_mps, velocity @ self._left
        return Balance(
            ahead=(float(ahead), float(speed)),
            left=(float(left), float(drift)),
            pitch=(pitch, float(rates[0])),
            yaw=(yaw, float(rates[1])),
        )


def leg(
    p: SteppingPattern, balance: Balance, outward: float, phase: float, growth: float
) -> dict[str, float]:
    """Return the angles of a leg in degrees.

    Args:
        p: The parameters.
        balance: Deviations of the trunk.
        outward: 1 for the left leg, -1 for the right one.
        phase: Phase of its steps, rad.
        growth: Share of the amplitudes, in [0, 1].
    """
    lift = growth * max(0.0, math.sin(phase + p.lift_lead_rad))
    load = 1.0 - lift * (1.0 - p.loaded)
    beside = (outward * balance.left[0], outward * balance.left[1])
    hip = load * (_gain(p.hip_pitch, balance.pitch) + _gain(p.hip_balance, balance.ahead))
    hip_lift = lift * (p.hip_lift + _gain(p.hip_catch, balance.ahead))
    ankle = load * _gain(p.ankle_balance, balance.ahead) + lift * p.ankle_lift
    abduction = load * _gain(p.abduction_balance, beside) + lift * _gain(p.abduction_catch, beside)
    return {
        "thigh.flexion": p.hip + hip + hip_lift + growth * _wave(p.hip_swing, phase),
        "thigh.abduction": p.abduction + abduction + growth * _wave(p.abduction_swing, phase),
        "thigh.internal_rotation": outward * _gain(p.yaw, balance.yaw),
        "shank.flexion": p.knee + lift * p.knee_lift,
        "foot.dorsiflexion": p.ankle + ankle + growth * _wave(p.ankle_swing, phase),
        "foot.inversion": p.inversion
        + load * _gain(p.inversion_balance, beside)
        + growth * _wave(p.inversion_swing, phase),
    }


def arm(p: SteppingPattern, phase: float, growth: float) -> dict[str, float]:
    """Return the angles of an arm in degrees; it swings against the leg of its side."""
    return {
        "upper_arm.flexion": p.arm - growth * p.arm_swing * math.sin(phase + p.hip_swing[1]),
        "upper_arm.abduction": p.arm_abduction,
        "forearm.flexion": p.elbow,
    }


def _gain(gains: tuple[float, float], deviation: tuple[float, float]) -> float:
    return gains[0] * deviation[0] + gains[1] * deviation[1]


def _wave(wave: tuple[float, float], phase: float) -> float:
    amplitude, shift = wave
    return amplitude * math.sin(phase + shift)

"""Proprioception: bone orientations, joint states and torques, and the vestibular sense.

The paper lists bone orientations, joint angles, joint angular velocities and the vestibular sense;
joint torques are an addition.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry import Floats, heading_rad
from veca_marl.sim.physics import GRAVITY_MPS2, World
from veca_marl.sim.sense import ArraySpec, Sense

_UP = np.array([0.0, 0.0, 1.0])


class ProprioceptionQuality(Enum):
    """The parts of the vector that are observed; the others read 0.

    Attributes:
        full: All parts.
        joints: Joint angles, velocities and torques.
        vestibular: Acceleration and angular velocity of the head.
    """

    full = "full"
    joints = "joints"
    vestibular = "vestibular"


@dataclass
class ProprioceptionCfg:
    """Settings of proprioception.

    Attributes:
        present: Whether the observation contains the sense.
        quality: See `ProprioceptionQuality`.
    """

    present: bool = True
    quality: ProprioceptionQuality = ProprioceptionQuality.full

    def __post_init__(self) -> None:
        if not isinstance(self.quality, ProprioceptionQuality):
            choices = [quality.name for quality in ProprioceptionQuality]
            raise ValueError(f"senses.proprioception.quality={self.quality!r}; choices: {choices}")


class ProprioceptionSense(Sense):
    """One vector: ``(534,)`` float32 for 47 bones and 82 joints.

    Its parts, in this order:

    ====================  ===========  ==========================================================
    part                  numbers      what
    ====================  ===========  ==========================================================
    bone_orientations     47 x 6       forward and up axis of each bone in the heading frame
                                       (vertical z axis, x axis along the heading of the pelvis),
                                       which shows the vertical but no compass direction. Two axes
                                       are a continuous representation of rotations, unlike
                                       quaternions (Zhou et al., CVPR 2019)
    joint_angles          82           rad
    joint_velocities      82           rad/s
    joint_torques         82           relative to the strength of the joint, [-1, 1]
    head_acceleration     3            m/s^2, specific force at the otoliths in the head frame:
                                       mean acceleration since the last read (one agent step if
                                       every step is read) minus gravity; (0, 0, 9.81) at rest
                                       and upright
    head_turning          3            rad/s, angular velocity in the head frame, as sensed by the
                                       semicircular canals
    ====================  ===========  ==========================================================

    Attributes:
        parts: Slice of each part in the vector.
    """

    cfg_type = ProprioceptionCfg

    def __init__(self, cfg: ProprioceptionCfg, body: Body, world: World) -> None:
        super().__init__(world)
        self._body, self._world = body, world
        self._measures: dict[str, Callable[[], Floats]] = {
            "bone_orientations": self._bone_orientations,
            "joint_angles": body.joint_angles,
            "joint_velocities": body.joint_velocities,
            "joint_torques": body.joint_torques,
            "head_acceleration": self._head_acceleration,
            "head_turning": self._head_turning,
        }
        self._observed = observed_parts(cfg.quality)
        self.parts = part_slices(len(body.bone_names), len(body.joint_names))
        size = self.parts["head_turning"].stop
        self.specs = {"proprioception": ArraySpec((size,), np.float32)}
        self.reset()

    def reset(self) -> None:
        """See `Sense`. Being placed elsewhere is not an acceleration."""
        super().reset()
        self._velocity, self._spin = self._body.head_motion()
        self._acceleration = np.zeros(3)
        self._step = self._world.step_count

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        self._measure_head()
        vector = np.zeros(self.parts["head_turning"].stop, np.float32)
        for name in self._observed:
            vector[self.parts[name]] = self._measures[name]()
        return {"proprioception": vector}

    def _measure_head(self) -> None:
        """Update velocity, spin and mean acceleration of the head since the last call."""
        before, step_before = self._velocity, self._step
        self._velocity, self._spin = self._body.head_motion()
        self._step = self._world.step_count
        elapsed_steps = max(self._step - step_before, 1)
        elapsed_s = elapsed_steps * self._world.clock.step_s
        self._acceleration = (self._velocity - before) / elapsed_s

    def _bone_orientations(self) -> Floats:
        rotations = self._body.bone_rotations()
        yaw = heading_rad(rotations[0])
        c, s = math.cos(yaw), math.sin(yaw)
        to_heading = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        axes: Floats = to_heading @ rotations[:, :, ::2]
        # per bone: forward axis, then up axis
        return np.swapaxes(axes, 1, 2).ravel()

    def _head_acceleration(self) -> Floats:
        specific_force: Floats = self._acceleration + GRAVITY_MPS2 * _UP
        return self._in_head(specific_force)

    def _head_turning(self) -> Floats:
        return self._in_head(self._spin)

    def _in_head(self, vector: Floats) -> Floats:
        in_head: Floats = self._body.mount("head").rotation.T @ vector
        return in_head


def observed_parts(quality: ProprioceptionQuality) -> tuple[str, ...]:
    """Return the names of the parts that a quality observes."""
    first_word = {
        ProprioceptionQuality.full: "",
        ProprioceptionQuality.joints: "joint",
        ProprioceptionQuality.vestibular: "head",
    }[quality]
    return tuple(part for part in part_slices(0, 0) if part.startswith(first_word))


def part_slices(bones: int, joints: int) -> dict[str, slice]:
    """Return the slice of each part in the vector for given numbers of bones and joints."""
    sizes = {
        "bone_orientations": 6 * bones,
        "joint_angles": joints,
        "joint_velocities": joints,
        "joint_torques": joints,
        "head_acceleration": 3,
        "head_turning": 3,
    }
    ends = np.cumsum(list(sizes.values())).tolist()
    starts = [0, *ends[:-1]]
    return {name: slice(*ends) for name, *ends in zip(sizes, starts, ends, strict=True)}

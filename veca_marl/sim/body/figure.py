"""What all humanoids share: 47 drawn bones, a head with eyes and ears, a voice.

How the bones come to be where they are is the business of each body.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import Action, checked_action
from veca_marl.sim.body.anatomy.bone_motion import bone_motion
from veca_marl.sim.body.anatomy.skeleton import load_skeleton
from veca_marl.sim.body.looks import SHIRTS, bone_geoms, dressed_skin
from veca_marl.sim.body.mounts import EYES, gaze, organ_pose, palm_of
from veca_marl.sim.body.voice import VOICE
from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.geometry.rotations import cross
from veca_marl.sim.physics.world import World
from veca_marl.sim.sound.calls import CALLS, Call, call_waveform
from veca_marl.sim.sound.sounds import Voice
from veca_marl.sim.spec import ArraySpec


class Figure:
    """Bones in the scene of a world, and the organs in its head.

    Args:
        name: Unique in its world.
        eye_range_deg: How far the eyes turn in the head.
        world: Where it is.
        shirt: Number of the shirt's colour.

    Attributes:
        action_spec: The parts of the action that `act` takes, by name.
    """

    action_spec: dict[str, ArraySpec]

    def __init__(self, name: str, eye_range_deg: float, world: World, shirt: int) -> None:
        self.name = name
        self._world = world
        self._skeleton = load_skeleton()
        colour = SHIRTS[shirt % len(SHIRTS)]
        self._drawn = world.scene.add_object(
            name, bone_geoms(self._skeleton, colour), dressed_skin(self._skeleton, colour)
        )
        self.object_id = self._drawn.id
        self._head = self._skeleton.bone("head")
        self.own_head_frames: tuple[int, ...] = (self._skeleton.bone("neck"), self._head)
        self._hands = [self._skeleton.bone(f"{side}_hand") for side in ("l", "r")]
        self._palms = np.array([palm_of(self._skeleton.bones[hand]) for hand in self._hands])
        self._voice = Voice(world.sound.sample_rate_hz)
        self._mouth = world.sound.add_source(f"{name}.voice", self._voice)
        self._eye_range_rad = math.radians(eye_range_deg)
        self.joint_names = tuple(f"{j.bone}.{j.label}" for j in self._skeleton.joints)
        self.bone_names = tuple(bone.name for bone in self._skeleton.bones)
        joints = len(self._skeleton.joints)
        self._angles, self._speeds, self._shares = (np.zeros(joints) for _ in range(3))
        self._pelvis_velocity, self._pelvis_spin = np.zeros(3), np.zeros(3)
        self._gaze_point: Floats | None = None
        self.focal_distance_m = math.inf

    # ---- where it is

    @property
    def position(self) -> Floats:
        """``(3,)`` metres: the pelvis in the world frame."""
        return np.array(self._drawn.positions[0])

    def bone(self, name: str) -> Pose:
        """Return the pose of a bone by name, such as `l_hand`."""
        index = self._skeleton.bone(name)
        return Pose(self._drawn.positions[index].copy(), self._drawn.rotations[index].copy())

    def palms(self) -> Floats:
        """Return the middles of the palms, left first, ``(2, 3)`` metres in the world frame."""
        positions, rotations = self._frames()
        centres: Floats = positions[self._hands] + np.einsum(
            "hij,hj->hi", rotations[self._hands], self._palms
        )
        return centres

    def bone_positions(self) -> Floats:
        """Return the origins of all bones, ``(47, 3)`` metres in the world frame."""
        return np.array(self._drawn.positions)

    def bone_rotations(self) -> Floats:
        """Return the frames of all bones, ``(47, 3, 3)`` to the world frame."""
        return np.array(self._drawn.rotations)

    def joint_angles(self) -> Floats:
        """Return all joint angles, ``(82,)`` rad, in the order of `joint_names`."""
        return self._angles.copy()

    def joint_velocities(self) -> Floats:
        """Return how fast all joints turn, ``(82,)`` rad/s."""
        return self._speeds.copy()

    def joint_torques(self) -> Floats:
        """Return what the joints' motors give, ``(82,)`` as shares of their strength."""
        return self._shares.copy()

    def velocities(self) -> Floats:
        """Return the velocities of the bones' origins, ``(47, 3)`` m/s in the world frame."""
        return self._bone_motion()[0]

    def angular_velocities(self) -> Floats:
        """Return the angular velocities of the bones, ``(47, 3)`` rad/s in the world frame."""
        return self._bone_motion()[1]

    def head_motion(self) -> tuple[Floats, Floats]:
        """Return velocity ``(3,)`` m/s and angular velocity ``(3,)`` rad/s of the middle head."""
        velocities, spins = self._bone_motion()
        lever = self.mount("head").position - self._drawn.positions[self._head]
        spin = spins[self._head]
        return velocities[self._head] + cross(spin, lever), spin

    def mount(self, name: str) -> Pose:
        """Return where a sense organ is; eyes include where they are turned to."""
        head = Pose(self._drawn.positions[self._head], self._drawn.rotations[self._head])
        organ = organ_pose(name, head)
        if name in EYES and self._gaze_point is not None:
            return gaze(organ, self._gaze_point, self._eye_range_rad)
        return organ

    # ---- actions

    def act(self, action: Mapping[str, Any]) -> None:
        """Apply an action: a value for each part of `action_spec`.

        Movement lasts until the next action. A call is played to its end: calls that are chosen
        in the meantime are ignored.

        Raises:
            ValueError: If a part is missing, unknown or out of its range; then nothing is applied.
        """
        parts = checked_action(self.action_spec, action)
        self._move(parts)
        if VOICE in parts:
            self.call(Call(int(parts[VOICE])))

    @abstractmethod
    def _move(self, parts: Action) -> None:
        """Apply the checked parts of an action that move the body."""

    def _with_voice(self, parts: dict[str, NDArray[Any]], call: Call) -> dict[str, NDArray[Any]]:
        """Return an action with a call, if this body's action has a part for it."""
        if VOICE in self.action_spec:
            parts[VOICE] = np.asarray(call, np.int64)
        return parts

    # ---- what its head can do (the paper's API)

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

    @property
    def muted(self) -> bool:
        """Whether nobody hears its voice, itself included. Stays until set anew."""
        return self._mouth.muted

    @muted.setter
    def muted(self, muted: bool) -> None:
        self._mouth.muted = muted

    def make_sound(self, waveform: NDArray[np.float32]) -> None:
        """Say something: samples at 22 050 Hz, heard by everyone, the speaker included."""
        self._voice.say(waveform)

    def call(self, call: Call) -> None:
        """Say a call, unless something is still being said."""
        if call is not Call.none and not self._voice.speaking:
            self._voice.say(call_waveform(CALLS[call], self._world.sound.sample_rate_hz))

    def _relax_eyes(self) -> None:
        self._gaze_point = None
        self.focal_distance_m = math.inf

    def _bone_motion(self) -> tuple[Floats, Floats]:
        return bone_motion(
            self._skeleton,
            self._angles,
            self._speeds,
            *self._frames(),
            self._pelvis_velocity,
            self._pelvis_spin,
        )

    def _frames(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the bones' positions and rotations in the scene, to write into."""
        return self._drawn.positions, self._drawn.rotations

"""The base class of all bodies: 47 bones in the scene, a head, a voice.

Senses, tasks and experts know bodies by this class. A subclass moves the bones: `Walker` by
kinematics, `Humanoid` by physics.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.action import VOICE, Action, checked_action, voice_spec
from veca_marl.sim.body.anatomy import (
    Growth,
    Skeleton,
    bone_motion,
    load_skeleton,
)
from veca_marl.sim.body.appearance import SHIRTS, bone_geoms, dressed_skin
from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.sense_organs import (
    EYES,
    Gaze,
    Sight,
    Visible,
    interactable_props,
    other_eye_m,
    palm_centre,
    resting_mount,
)
from veca_marl.sim.geometry import Floats, Pose, cross
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.sense import ArraySpec
from veca_marl.sim.sound import CALLS, Call, Voice, call_waveform


class Body(ABC):
    """A humanoid in a world.

    A subclass sets `cfg_type`, gives the constructor the parts of its action that move it,
    attaches itself to the world (`World.attach`) and writes the poses of its bones with `_frames`
    when the world calls `write_frames`.

    Args:
        name: Unique in its world.
        cfg: Its parameters.
        world: The world, not yet frozen.
        shirt: Index of the shirt's colour.

    Attributes:
        cfg_type: Class of the configuration that describes this kind of body.
        name: Unique in its world.
        object_id: The id of its bones in the world's `Scene` and in segmentation images.
        action_spec: The parts of the action that `act` takes, by name: a float32 vector in
            [-1, 1], or one of several choices (shape ``()``, int64).
        own_head_frames: Indices of the frames (bones) that its own eyes do not see.
        deaf_to: Names of sound sources that its ears do not hear, for experiments on communication:
            a prop that emits a sound, or ``NAME.voice`` of the player NAME. `Task.build` fills it;
            it stays as it is for the life of the world.
        joint_names: The 82 joints, such as `l_forearm.flexion`, in the order of all joint arrays.
        bone_names: The 47 bones, such as `l_forearm`, in the order of all bone arrays.
        interaction_range_m: See `BodyCfg`; that of this body.
    """

    cfg_type: ClassVar[type[BodyCfg]]
    action_spec: dict[str, ArraySpec]

    def __init__(self, name: str, cfg: BodyCfg, world: World, shirt: int = 0) -> None:
        self.name = name
        self._world = world
        self._skeleton = load_skeleton(cfg.growth)
        self._head_size = self._skeleton.growth.head_size
        self._add_to_scene(SHIRTS[shirt % len(SHIRTS)])
        self._head = self._skeleton.bone("head")
        self.own_head_frames: tuple[int, ...] = (self._skeleton.bone("neck"), self._head)
        self._hands = [self._skeleton.bone(f"{side}_hand") for side in ("l", "r")]
        self._palms = np.array([palm_centre(self._skeleton.bones[hand]) for hand in self._hands])
        self._voice = Voice(world.sound.sample_rate_hz)
        self._mouth = world.sound.add_source(f"{name}.voice", self._voice)
        self._gaze = Gaze(math.radians(cfg.eye_range_deg), self._head_size)
        self._sight: Sight | None = None
        self._call_pause_s = cfg.call_pause_s
        self.interaction_range_m = cfg.interaction_range_m * self.growth.size
        self.joint_names = tuple(f"{j.bone}.{j.label}" for j in self._skeleton.joints)
        self.bone_names = tuple(bone.name for bone in self._skeleton.bones)
        joints = len(self._skeleton.joints)
        self._angles, self._speeds, self._torques = (np.zeros(joints) for _ in range(3))
        self._pelvis_velocity, self._pelvis_spin = np.zeros(3), np.zeros(3)
        self.action_spec = {**self._movement_spec(cfg), **voice_spec(cfg.voice)}
        self.deaf_to: set[str] = set()

    def _add_to_scene(self, shirt: tuple[float, float, float]) -> None:
        scene = self._world.scene
        self._drawn = scene.add_object(
            self.name, bone_geoms(self._skeleton, shirt), dressed_skin(self._skeleton, shirt)
        )
        self.object_id = self._drawn.id

    # ---- what each kind of body defines

    @property
    def world(self) -> World:
        """The world in which it is."""
        return self._world

    @property
    def skeleton(self) -> Skeleton:
        """Its bones and joints. It must not be changed."""
        return self._skeleton

    @property
    def growth(self) -> Growth:
        """Its size."""
        return self._skeleton.growth

    @property
    @abstractmethod
    def body_id(self) -> int:
        """PyBullet's id of what collides: a capsule, or the articulated bones."""

    @property
    def obstacle_ids(self) -> tuple[int, ...]:
        """PyBullet's ids of what walkers are kept out of; empty for walkers themselves."""
        return ()

    @property
    @abstractmethod
    def velocity(self) -> Floats:
        """``(3,)`` m/s: velocity of the pelvis in the world frame."""

    @property
    @abstractmethod
    def forward(self) -> Floats:
        """``(3,)`` horizontal unit vector that the trunk faces."""

    @property
    def is_finite(self) -> bool:
        """Whether the simulation of this body is valid; if not, the world must be rebuilt."""
        return True

    @abstractmethod
    def _movement_spec(self, cfg: Any) -> dict[str, ArraySpec]:
        """Return the parts of the action that move the body."""

    @abstractmethod
    def _move(self, parts: Action) -> None:
        """Apply the checked parts of an action that move the body."""

    @abstractmethod
    def encode(self, command: Any) -> dict[str, NDArray[Any]]:
        """Return the action that comes nearest to an expert's command."""

    @abstractmethod
    def rest(self) -> None:
        """Stand still, or hold the joints where they are, until the next action."""

    @abstractmethod
    def place(self, position: Floats | tuple[float, float, float], yaw_rad: float = 0.0) -> None:
        """Start at a place on the floor, facing `yaw_rad`, at rest.

        Raises:
            ValueError: If a number is not finite.
        """

    # ---- calls from the world, see `Mover`

    def reset(self) -> None:
        """Return to the pose in which the body was built, at the origin, looking straight ahead.

        `World.reset` restores colours and sounds of everything in the world. Tasks then put the
        body in its starting place.
        """
        self.place((0.0, 0.0, 0.0))

    @property
    def needs_physics(self) -> bool:
        """Whether it acts in the physics steps of this agent step, once that is prepared."""
        return True

    def after_substep(self, substep_s: float) -> None:  # noqa: B027  optional
        """Do nothing after a physics step; bodies with simulated joints apply their limits."""

    # ---- poses and motion

    @property
    def position(self) -> Floats:
        """``(3,)`` metres: the pelvis in the world frame."""
        return np.array(self._drawn.positions[0])

    def bone(self, name: str) -> Pose:
        """Return the pose of a bone by name, such as `l_hand`."""
        index = self._skeleton.bone(name)
        return Pose(self._drawn.positions[index].copy(), self._drawn.rotations[index].copy())

    def palms(self) -> Floats:
        """Return the centres of the palms, left first, ``(2, 3)`` metres in the world frame."""
        positions, rotations = self._frames()
        centres: Floats = positions[self._hands] + np.einsum(
            "hij,hj->hi", rotations[self._hands], self._palms
        )
        return centres

    def bone_positions(self) -> Floats:
        """Return the origins of all bones, ``(47, 3)`` metres in the world frame."""
        return np.array(self._drawn.positions)

    def bone_rotations(self) -> Floats:
        """Return the rotations of all bones, ``(47, 3, 3)``, from their frames to the world's."""
        return np.array(self._drawn.rotations)

    def joint_angles(self) -> Floats:
        """Return all joint angles, ``(82,)`` rad, in the order of `joint_names`."""
        return self._angles.copy()

    def joint_velocities(self) -> Floats:
        """Return all joint velocities, ``(82,)`` rad/s."""
        return self._speeds.copy()

    def joint_torques(self) -> Floats:
        """Return the motor torques, ``(82,)`` in [-1, 1] of each joint's greatest torque.

        They are those at the start of the last physics step. Joint damping is not part of them.
        """
        return self._torques.copy()

    def velocities(self) -> Floats:
        """Return the velocities of the bones' origins, ``(47, 3)`` m/s in the world frame."""
        return self._bone_motion()[0]

    def angular_velocities(self) -> Floats:
        """Return the angular velocities of the bones, ``(47, 3)`` rad/s in the world frame."""
        return self._bone_motion()[1]

    def head_motion(self) -> tuple[Floats, Floats]:
        """Return velocity ``(3,)`` m/s and angular velocity ``(3,)`` rad/s of the head's centre."""
        velocities, spins = self._bone_motion()
        lever = self.mount("head").position - self._drawn.positions[self._head]
        spin = spins[self._head]
        return velocities[self._head] + cross(spin, lever), spin

    def mount(self, name: str) -> Pose:
        """Return the pose of a sense organ, one of `MOUNTS`; eyes look along their x axis."""
        head = Pose(self._drawn.positions[self._head], self._drawn.rotations[self._head])
        organ = resting_mount(name, head, self._head_size)
        if name not in EYES:
            return organ
        return self._gaze.turned(name, self._kept_eye(organ, other_eye_m(name, self._head_size)))

    def _kept_eye(self, eye: Pose, to_other_m: float) -> Pose:
        """Return the pose of an eye, which bodies may keep off walls or the floor.

        Args:
            eye: Its pose when it looks straight ahead.
            to_other_m: See `other_eye_m`.
        """
        return eye

    def touches(self, prop: Prop) -> bool:
        """Return whether any part of the body is in contact with a prop."""
        return prop.touches(self.body_id)

    def state(self) -> dict[str, Floats]:
        """Return what the simulator knows of it, by name; the shapes are always the same.

        Returns:
            ``position`` (metres), ``forward`` and ``up`` (unit vectors) of the pelvis, its
            ``velocity`` (m/s) and ``spin`` (rad/s), and the direction ``gaze`` of the left eye,
            all ``(3,)`` in the world frame; ``calling``, ``(1,)``: 1 while its voice is in use.
        """
        velocities, spins = self._bone_motion()
        pelvis = self._drawn.rotations[0]
        return {
            "position": self.position,
            "forward": pelvis[:, 0].copy(),
            "up": pelvis[:, 2].copy(),
            "velocity": velocities[0],
            "spin": spins[0],
            "gaze": self.mount("eye_left").rotation[:, 0].copy(),
            "calling": np.array([float(self._voice.speaking)]),
        }

    # ---- actions

    def info(self) -> dict[str, float]:
        """Return numbers for logs on the last step, by name; the names are always the same."""
        return {}

    def act(self, action: Mapping[str, Any]) -> None:
        """Apply an action: a value for each part of `action_spec`.

        Movement lasts until the next action. A call is played to its end, with the pause after it:
        calls that are chosen in the meantime are ignored.

        Raises:
            ValueError: If a part is missing, unknown or out of its range; then nothing is applied.
        """
        parts = checked_action(self.action_spec, action)
        self._move(parts)
        if VOICE in parts:
            self.call(Call(int(parts[VOICE])))

    def _with_voice(self, parts: dict[str, NDArray[Any]], call: Call) -> dict[str, NDArray[Any]]:
        """Return an action with a call, if this body's action has a part for it."""
        if VOICE in self.action_spec:
            parts[VOICE] = np.asarray(call, np.int64)
        return parts

    # ---- eyes and voice (the paper's API)

    @property
    def focal_distance_m(self) -> float:
        """The distance to which the lenses of the eyes are adjusted; ``inf`` when relaxed."""
        return self._gaze.focal_distance_m

    def look_toward_point(self, point: Floats | tuple[float, float, float]) -> None:
        """Turn the eyes, not the head, to a point and keep them there until `release_look`.

        Raises:
            ValueError: If `point` is not three finite metres.
        """
        self._gaze.look_toward(point)

    def release_toward_point(self) -> None:
        """Let the eyes look straight ahead again: the end of `look_toward_point`."""
        self._gaze.point = None

    def release_look(self) -> None:
        """Let the eyes look straight ahead again; `release_toward_point` by its shorter name."""
        self.release_toward_point()

    def adjust_focal_length(self, focal_distance_m: float) -> None:
        """Adjust the lenses to a distance in metres; ``inf`` is relaxed.

        Raises:
            ValueError: If the distance is not positive.
        """
        self._gaze.adjust(focal_distance_m)

    @property
    def teleports(self) -> int:
        """How often its head was moved at once, which is no motion: no sound is shifted by it."""
        return self._mouth.teleports

    @property
    def muted(self) -> bool:
        """Whether the voice is inaudible to all agents, including this one; False after a reset."""
        return self._mouth.muted

    @muted.setter
    def muted(self, muted: bool) -> None:
        self._mouth.muted = muted

    def make_sound(self, waveform: NDArray[np.float32]) -> None:
        """Play samples at 22 050 Hz from the mouth; all agents hear them, including this one."""
        self._voice.say(waveform)

    def call(self, call: Call) -> None:
        """Play a call and the pause after it.

        It is ignored while another sound of this mouth is being played, or the pause after a call.
        """
        if call is not Call.none and not self._voice.speaking:
            rate_hz = self._world.sound.sample_rate_hz
            self._voice.say(call_waveform(CALLS[call].pitched(self.growth.pitch), rate_hz))
            self._voice.say(np.zeros(round(self._call_pause_s * rate_hz)))

    # ---- visible and interactable objects (the paper's API)

    @property
    def sight(self) -> Sight:
        """The present images of its eyes; `make_senses` sets it.

        Raises:
            RuntimeError: If it was not set.
        """
        if self._sight is None:
            raise RuntimeError(
                f"{self.name} has no eyes yet: make_senses or veca_marl.sim.vision.open_eyes "
                "gives them to a body"
            )
        return self._sight

    @sight.setter
    def sight(self, sight: Sight) -> None:
        self._sight = sight

    def is_visible(self, target: Visible, eye: str | None = None) -> bool:
        """Return whether its eyes see a prop or body, also through transparent objects.

        Args:
            target: A prop or a body.
            eye: ``eye_left`` or ``eye_right``; None is either.

        Raises:
            ValueError: If this is not an open eye.
        """
        return self.sight.is_visible(target.object_id, eye)

    def is_interactable(self, prop: Prop) -> bool:
        """Return whether a prop is among `interactable_objects`."""
        return bool(self._interactable([prop]))

    def interactable_objects(self, where: Callable[[Prop], bool] | None = None) -> list[Prop]:
        """Return the props that can be interacted with, nearest to the centre of the view first.

        A prop is interactable if it declares an interaction (`PropCfg.interactions`), a pixel of an
        open eye shows it with no transparent object in front, and its bounding box is nearer to the
        head than `interaction_range_m`. What the body itself holds is left out.

        Args:
            where: Only props for which it returns True; None for all. It is asked first, since
                looking for a prop in the images takes longer.
        """
        props = self._world.props.values()
        return self._interactable(props if where is None else filter(where, props))

    def interactable_object(self) -> Prop | None:
        """Return the interactable prop nearest to the centre of the view; None if there is none."""
        objects = self.interactable_objects()
        return objects[0] if objects else None

    def _interactable(self, props: Iterable[Prop]) -> list[Prop]:
        others = [prop for prop in props if prop.holder != self.name]
        head = self.mount("head").position
        return interactable_props(self.sight, head, others, self.interaction_range_m)

    # ---- for subclasses

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

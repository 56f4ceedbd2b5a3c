"""Toys that are dropped on a hand, felt for 0.512 s.

The hand is held still, palm up: its bones have no mass and do not yield, its skin does. A physics
engine of its own for each sample keeps samples independent of each other to the last bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from veca_marl.datasets.dataset import (
    TRIES,
    Dataset,
    DatasetCfg,
    NoSceneError,
    Sample,
    register_dataset,
)
from veca_marl.datasets.fields import Field, Role
from veca_marl.datasets.kinds.still_skin import BonePoses, SkinObservation, StillSkin
from veca_marl.datasets.kinds.toy_scenes import random_rotation
from veca_marl.sim.body.anatomy import (
    SkinLayer,
    SkinSpring,
    load_skeleton,
    skin_layer,
    skin_spring,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import OFFERING, pelvis_rotation, posture_angles
from veca_marl.sim.body.sense_organs import palm_centre
from veca_marl.sim.geometry import (
    Floats,
    Geom,
    Pose,
    Primitive,
    matrix_to_quaternion,
    quaternions_to_matrices,
    rotation_about_vertical,
)
from veca_marl.sim.physics import (
    GRAVITY_MPS2,
    BulletClient,
    ClockCfg,
    PlaygroundCfg,
    PropCfg,
    create_collision_shape,
)
from veca_marl.sim.physics.props.geoms import lowest_m, prop_geoms
from veca_marl.sim.physics.props.rigid_body import create_prop_body
from veca_marl.sim.physics.props.toys import ToyKind, toy
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.touch import TouchCfg
from veca_marl.sim.touch.taxels import load_taxels

STEP_S = 0.004
STEPS = 128
KINDS = (ToyKind.pyramid, ToyKind.sphere, ToyKind.cube, ToyKind.cylinder)
"""The paper's, in the order of the labels."""

_HAND = "r_hand"
_FINGERS = tuple(f"r_{finger}_" for finger in ("index", "middle", "ring", "little"))
_ITERATIONS = 50  # of the solver, so that a toy rests on several fingers


@dataclass
class TactileClassificationCfg(DatasetCfg):
    """Numbers of object classification by touch.

    Attributes:
        width_m: Least and greatest width of a toy; the palm is 0.04 m wide.
        mass_kg: Least and greatest mass.
        height_m: Least and greatest height of its lowest point above the palm.
        aside_m: Greatest distance of its centre from that of the palm along either axis.
        tilt_deg: Greatest tilt of the palm.
        curl_deg: Greatest flexion of each joint of the fingers.
        least_steps: Fewest of the 128 steps in which the hand feels it.
    """

    name: str = "tactile_classification"
    width_m: tuple[float, float] = (0.025, 0.045)
    mass_kg: tuple[float, float] = (0.05, 0.25)
    height_m: tuple[float, float] = (0.005, 0.05)
    aside_m: float = 0.01
    tilt_deg: float = 10.0
    curl_deg: float = 25.0
    least_steps: int = 40

    def __post_init__(self) -> None:
        self.check_range("width_m", 0.01, 0.2)
        self.check_range("mass_kg", 0.001, 5.0)
        self.check_range("height_m", 0.0, 0.5)
        self.check_numbers(
            aside_m=(0.0, 0.2),
            tilt_deg=(0.0, 60.0),
            curl_deg=(0.0, 40.0),
            least_steps=(0, STEPS),
        )


def hand_bones() -> list[str]:
    """Return the names of the right hand and of its fingers."""
    skeleton = load_skeleton()
    hand = skeleton.bone(_HAND)
    own = {hand}
    for index, bone in enumerate(skeleton.bones):
        if bone.parent in own:
            own.add(index)
    return [skeleton.bones[index].name for index in sorted(own)]


@register_dataset
class TactileClassification(Dataset):
    """Which of four toys fell on a hand, felt for 128 steps of 4 ms (the paper's set)."""

    cfg_type = TactileClassificationCfg
    senses_used = ("touch",)

    def __init__(
        self, cfg: TactileClassificationCfg, senses: SensesCfg, playground: PlaygroundCfg
    ) -> None:
        self.cfg = cfg
        self._touch: TouchCfg = senses.of("touch")
        self._bones = hand_bones()
        skeleton, first = load_skeleton(), load_taxels().first_triangle
        ranges = [np.arange(first[i], first[i + 1]) for i in map(skeleton.bone, self._bones)]
        self._observe = SkinObservation(self._touch, np.concatenate(ranges))
        self._curled = [
            i
            for i, joint in enumerate(skeleton.joints)
            if joint.label == "flexion"
            and joint.bone.startswith(tuple(f"r_{f}_" for f in _FINGERS))
        ]
        self.fields = {
            **{
                name: Field(
                    (STEPS, size), "uint8", Role.input, 0, 255, "1/255 of a complete compression",
                    f"readings of the {'taxels' if name == 'touch' else 'parts'} of the right hand "
                    "after each of 128 steps of 4 ms",
                    () if name == "touch" else self._observe.part_names,
                )
                for name, size in self._observe.sizes.items()
            },
            "kind": Field(
                (), "int64", Role.label, 0, len(KINDS) - 1, "class", "shape of the toy",
                tuple(kind.value for kind in KINDS),
            ),
            "width": Field(
                (), "float32", Role.extra, 0.999 * cfg.width_m[0], 1.001 * cfg.width_m[1], "m",
                "width of the toy",
            ),
            "mass": Field(
                (), "float32", Role.extra, 0.999 * cfg.mass_kg[0], 1.001 * cfg.mass_kg[1], "kg",
                "mass of the toy",
            ),
        }  # fmt: skip

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        for _ in range(TRIES):
            kind = int(rng.integers(len(KINDS)))
            width_m, mass_kg = float(rng.uniform(*self.cfg.width_m)), rng.uniform(*self.cfg.mass_kg)
            thing = toy("toy", KINDS[kind], (0.0, 0.0), width_m=width_m, mass_kg=float(mass_kg))
            geoms = prop_geoms(thing)
            poses = self._draw_hand(rng)
            start = self._draw_start(rng, poses, geoms)
            skin = StillSkin(self._touch, poses, geoms, self._bones)
            felt = 0
            recorded: dict[str, Floats] = {
                name: np.zeros((STEPS, size), np.uint8)
                for name, size in self._observe.sizes.items()
            }
            for step, pose in enumerate(dropped(thing, geoms, start, poses, self._bones)):
                readings = skin.press(pose)
                if readings.any():
                    felt += 1
                    for name, values in self._observe(readings).items():
                        recorded[name][step] = values
            if felt >= self.cfg.least_steps:
                return {
                    **recorded,
                    "kind": np.array(kind, np.int64),
                    "width": np.array(width_m, np.float32),
                    "mass": np.array(mass_kg, np.float32),
                }
        raise NoSceneError(self.name)

    def _draw_hand(self, rng: np.random.Generator) -> BonePoses:
        """Return a body that offers its right hand, with the centre of the palm at the origin."""
        angles = posture_angles(load_skeleton(), OFFERING)
        angles[self._curled] = np.radians(rng.uniform(0.0, self.cfg.curl_deg, len(self._curled)))
        poses = BonePoses.of(Pose(np.zeros(3), pelvis_rotation(OFFERING, 0.0)), angles)
        tilt = np.radians(rng.uniform(-self.cfg.tilt_deg, self.cfg.tilt_deg, 2))
        turn = Rotation.from_euler("XY", tilt).as_matrix()
        yaw = rotation_about_vertical(float(rng.uniform(-math.pi, math.pi)))
        up = poses.bone(_HAND).rotation[:, 1]  # the palm of the right hand faces its y axis
        level = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])[0].as_matrix()
        turned = poses.turned(turn @ yaw @ level, np.zeros(3))
        hand = turned.bone(_HAND)
        bone = load_skeleton().bones[load_skeleton().bone(_HAND)]
        palm = hand.position + hand.rotation @ palm_centre(bone)
        return BonePoses(turned.positions - palm, turned.rotations)

    def _draw_start(
        self, rng: np.random.Generator, poses: BonePoses, geoms: tuple[Geom, ...]
    ) -> Pose:
        """Return the pose from which a toy falls, above the palm."""
        rotation = random_rotation(rng)
        aside = rng.uniform(-self.cfg.aside_m, self.cfg.aside_m, 2)
        height_m = rng.uniform(*self.cfg.height_m) - lowest_m(geoms, rotation)
        hand = poses.bone(_HAND).rotation
        # along the hand and across it, in the plane of the palm
        position = aside[0] * hand[:, 0] + aside[1] * hand[:, 2]
        return Pose(position + np.array([0.0, 0.0, height_m]), rotation)


def dropped(
    thing: PropCfg, geoms: tuple[Geom, ...], start: Pose, poses: BonePoses, bones: list[str]
) -> Iterator[Pose]:
    """Drop a toy on a hand; yield its pose after each of `STEPS` steps.

    Args:
        thing: The toy.
        geoms: Its primitives.
        start: Where it starts, at rest.
        poses: Poses of the bones, which do not move.
        bones: Those that it can hit.
    """
    with closing(BulletClient()) as client:
        client.setGravity(0.0, 0.0, -GRAVITY_MPS2)
        client.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S,
            numSolverIterations=_ITERATIONS,
            solverResidualThreshold=0.0,
            deterministicOverlappingPairs=1,
            contactBreakingThreshold=ClockCfg().contact_share,
        )
        for name in bones:
            _add_bone(client, name, poses.bone(name))
        toy_id, frame = create_prop_body(thing, client, geoms)
        centre = start.position + start.rotation @ frame.position
        turned = matrix_to_quaternion(start.rotation @ frame.rotation)
        client.resetBasePositionAndOrientation(toy_id, centre.tolist(), turned.tolist())
        for _ in range(STEPS):
            client.stepSimulation()
            position, quaternion = client.getBasePositionAndOrientation(toy_id)
            yield _pose_of_frame(position, quaternion, frame)


def _pose_of_frame(position: object, quaternion: object, frame: Pose) -> Pose:
    """Return the pose of a toy from that of its centre of mass in Bullet."""
    matrix = np.empty((1, 3, 3))
    quaternions_to_matrices(np.array([quaternion], np.float64), matrix)
    rotation = matrix[0] @ frame.rotation.T
    return Pose(np.array(position, np.float64) - rotation @ frame.position, rotation)


@functools.cache
def _colliders(name: str) -> tuple[tuple[Primitive, SkinSpring | None], ...]:
    """Return the colliders of a bone, those of the joint-level body; soft ones have a spring."""
    skeleton = load_skeleton()
    bone = skeleton.bones[skeleton.bone(name)]
    layer = skin_layer(bone)
    found: list[tuple[Primitive, SkinSpring | None]] = []
    for part in bone.colliders:
        if layer is not SkinLayer.SKIN:
            found.append((part, None))
        if layer is not SkinLayer.BONE:
            found.append((part.grown(bone.skin_thickness_m), skin_spring(bone)))
    return tuple(found)


def _add_bone(client: BulletClient, name: str, pose: Pose) -> None:
    """Add the colliders of a bone that does not move."""
    for part, spring in _colliders(name):
        body = _add_collider(client, part, pose)
        if spring is not None:
            client.changeDynamics(
                body,
                -1,
                contactStiffness=spring.stiffness_npm,
                contactDamping=spring.damping_nspm,
            )


def _add_collider(client: BulletClient, part: Primitive, pose: Pose) -> int:
    shape = create_collision_shape(client, [part])
    body: int = client.createMultiBody(
        0.0,
        shape,
        basePosition=pose.position.tolist(),
        baseOrientation=matrix_to_quaternion(pose.rotation).tolist(),
    )
    client.changeDynamics(body, -1, lateralFriction=HumanoidCfg().friction, restitution=0.0)
    return body

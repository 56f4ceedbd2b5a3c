"""The skeleton as URDF text, from which Bullet makes the joint-level body.

Every degree of freedom is a hinge. A bone with three of them hangs on two almost massless links
(`<bone>__0`, `<bone>__1`), which are written before it: Bullet's solver wants parents first.

With fingers no link has more than one shape; further ones have links of their own
(`<bone>__part1`). Of two shapes in a link Bullet solves the contacts in an order that depends on
episodes long past, and a single one it takes as it is, where the frame of the link's inertia is
that of the shape. Otherwise it wraps it up, which costs more, and what comes near is noticed only
when it is within the bounding box. Without fingers there are up to 16 shapes in a hand, too many
for links of their own: there the shapes of a link are one, their hull, as in a mitten, and the
thumb is a second one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.hulls import as_obj, surface_points
from veca_marl.sim.body.anatomy.skeleton import Bone, Joint, Skeleton
from veca_marl.sim.body.anatomy.skin_springs import SkinLayer, is_finger, skin_layer, skin_spring
from veca_marl.sim.geometry import Floats, Inertia, Pose, Primitive, joined_inertia
from veca_marl.sim.physics import urdf_geometry

SKIN_SUFFIX, THUMB_SUFFIX = "__skin", "__thumb"
_LIGHT_SHARE = 0.01  # of its bone's mass, for each link that is not a bone
_GIMBAL_LOCK = 1e-9
_HERE = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class Build:
    """How the skeleton becomes a multibody.

    Attributes:
        fingers: Whether they move; if not, they are one with the hand, straight.
        strength: Share of the torques in the table.
        free_speed_radps: Speed at which the damping of a joint takes its full torque up.
        rotor_s: A link's added inertia over the damping of its joints: Bullet damps explicitly,
            which is stable (``dt max eig(M^-1 D) <= 1``) up to a time step of about a third of it.
        friction: Lateral friction of the skin.
    """

    fingers: bool = True
    strength: float = 1.0
    free_speed_radps: float = 20.0
    rotor_s: float = 0.0215
    friction: float = 0.8


def bone_of(link: str) -> str:
    """Return the bone that a link with a shape belongs to; the link itself if it has none."""
    bone, _, rest = link.partition("__")
    return link if rest.isdigit() else bone


class BodyFiles(NamedTuple):
    """A body as Bullet reads it.

    Attributes:
        urdf: The robot.
        hulls: Names of the files it refers to, and what they hold.
    """

    urdf: str
    hulls: dict[str, str]


def body_files(skeleton: Skeleton, build: Build) -> BodyFiles:
    """Return the body as a URDF robot.

    Joints are called `<bone>.<label>` as in the table, links as their bones.
    """
    writer = _Writer(skeleton, build)
    parts = [writer.bone(i) for i in range(len(skeleton.bones)) if not writer.is_fixed(i)]
    text = '<?xml version="1.0"?>\n<robot name="child">\n' + "\n".join(parts) + "\n</robot>\n"
    return BodyFiles(text, writer.hulls)


class _Shape(NamedTuple):
    """A shape of a link.

    Attributes:
        pose: Its place in the link's frame.
        geometry: What it is as URDF.
        points: ``(n, 3)`` its hull, in the link's frame.
    """

    pose: Pose
    geometry: str
    points: Floats


class _Layer(NamedTuple):
    """A link with shapes that are all rigid or all soft."""

    link: str
    shapes: Sequence[_Shape]
    soft: bool


class _Writer:
    def __init__(self, skeleton: Skeleton, build: Build) -> None:
        self._skeleton = skeleton
        self._build = build
        self.hulls: dict[str, str] = {}

    def is_fixed(self, index: int) -> bool:
        return not self._build.fingers and is_finger(self._skeleton.bones[index])

    def bone(self, index: int) -> str:
        """Write a bone, with what is fixed to it, and all that hangs it on its parent."""
        bone = self._skeleton.bones[index]
        members = self._members(index)
        layers, light = self._layers(bone, members), _LIGHT_SHARE * bone.mass_kg
        links = max(bone.joint_count - 1, 0) + len(layers) - 1
        whole = joined_inertia([(pose, part.inertia()) for part, pose in members])
        own = whole._replace(mass_kg=whole.mass_kg - links * light)
        text = self._hinges(bone, light)
        text += self._link(layers[0], own, self._rotor(bone), bone)
        return text + "".join(self._fixed(layer, light, bone) for layer in layers[1:])

    def _layers(self, bone: Bone, members: list[tuple[Bone, Pose]]) -> list[_Layer]:
        """Return the links of a bone that have shapes; the first is the bone itself."""
        layer = skin_layer(bone)
        rigid = [shape for part, pose in members if _is_rigid(part) for shape in _bare(part, pose)]
        soft, thumb = (
            [
                shape
                for part, pose in members
                if _is_soft(part) and _is_thumb_on(bone, part) is of_thumb
                for shape in _skinned(part, pose)
            ]
            for of_thumb in (False, True)
        )
        layers = [_Layer(bone.name, rigid, soft=False)]
        if layer is SkinLayer.SKIN:
            layers = [_Layer(bone.name, soft, soft=True)]
        elif layer is SkinLayer.SKIN_OVER_BONE:
            layers.append(_Layer(bone.name + SKIN_SUFFIX, soft, soft=True))
        if thumb:
            layers.append(_Layer(bone.name + THUMB_SUFFIX, thumb, soft=True))
        if self._build.fingers:
            return [one for layer in layers for one in _singly(layer)]
        return [self._hulled(layer) for layer in layers]

    def _hulled(self, layer: _Layer) -> _Layer:
        """Make one shape of those of a link."""
        if len(layer.shapes) < 2:
            return layer
        points = np.concatenate([shape.points for shape in layer.shapes])
        file = f"{layer.link}.obj"
        self.hulls[file] = as_obj(points)
        return layer._replace(shapes=[_Shape(_HERE, f'<mesh filename="{file}"/>', points)])

    def _members(self, index: int) -> list[tuple[Bone, Pose]]:
        """Return a bone and those fixed to it, with their poses in its frame."""
        bones = self._skeleton.bones
        poses = {index: _HERE}
        for child in range(index + 1, len(bones)):
            if self.is_fixed(child) and bones[child].parent in poses:
                up = poses[bones[child].parent]
                place = up.position + up.rotation @ np.array(bones[child].origin)
                poses[child] = Pose(place, up.rotation @ bones[child].rest_rotation)
        return [(bones[member], pose) for member, pose in poses.items()]

    def _hinges(self, bone: Bone, light_kg: float) -> str:
        if bone.parent < 0:
            return ""
        parent, origin = self._skeleton.bones[bone.parent].name, _origin(_rest(bone))
        text = ""
        for step in range(bone.joint_count):
            last = step == bone.joint_count - 1
            child = bone.name if last else f"{bone.name}__{step}"
            if not last:
                empty = _Layer(child, (), soft=False)
                text += self._link(empty, _speck(light_kg), self._rotor(bone))
            joint = self._skeleton.joints[bone.first_joint + step]
            text += (
                f'<joint name="{joint.bone}.{joint.label}" type="revolute">'
                f'<parent link="{parent}"/><child link="{child}"/>{origin}'
                f'<axis xyz="{_numbers(*joint.axis)}"/>'
                f'<limit lower="{joint.low_rad!r}" upper="{joint.high_rad!r}" '
                f'effort="{self._torque(joint)!r}" velocity="100"/>'
                f'<dynamics damping="{self._torque(joint) / self._build.free_speed_radps!r}"/>'
                "</joint>\n"
            )
            parent, origin = child, _origin(_HERE)
        return text

    def _fixed(self, layer: _Layer, light_kg: float, bone: Bone) -> str:
        """Write a light link that is one with the bone's."""
        name, centre = layer.link, layer.shapes[0].pose.position
        speck = _speck(light_kg)._replace(centre=centre)
        return self._link(layer, speck, 1e-7, bone) + (
            f'<joint name="{name}" type="fixed"><parent link="{bone.name}"/>'
            f'<child link="{name}"/></joint>\n'
        )

    def _rotor(self, bone: Bone) -> float:
        """Return the inertia that links of a bone have added, as of the rotors of motors, kg m2."""
        joints = self._skeleton.joints[bone.first_joint : bone.first_joint + bone.joint_count]
        if not joints:  # the pelvis: as the spine, which pushes against it
            joints = self._skeleton.joints[:1]
        damping = max(map(self._torque, joints)) / self._build.free_speed_radps
        return damping * self._build.rotor_s

    def _torque(self, joint: Joint) -> float:
        return self._build.strength * joint.torque_nm

    def _link(self, layer: _Layer, inertia: Inertia, rotor: float, bone: Bone | None = None) -> str:
        spring = ""
        if bone is not None and layer.soft:
            skin = skin_spring(bone)
            spring = f'<stiffness value="{skin.stiffness_npm!r}"/>'
            spring += f'<damping value="{skin.damping_nspm!r}"/>'
        friction = f'<lateral_friction value="{self._build.friction!r}"/>'
        shapes = "".join(
            f"<collision>{_origin(shape.pose)}<geometry>{shape.geometry}</geometry></collision>"
            for shape in layer.shapes
        )
        matrix = inertia.matrix + rotor * np.eye(3)
        axes = _principal_axes(inertia.centre, matrix)
        if self._build.fingers and layer.link != self._skeleton.bones[0].name:  # the base's is read
            axes = _of_shape(layer.shapes, axes, matrix)
        return (
            f'<link name="{layer.link}"><contact>{friction}{spring}</contact>'
            f"{_inertial(inertia.mass_kg, axes, matrix)}{shapes}</link>\n"
        )


def _is_thumb_on(hand: Bone, part: Bone) -> bool:
    """Whether a bone is of a thumb that is fixed to a hand: a mitten has no web beside its palm."""
    return part is not hand and "_thumb_" in part.name


def _is_rigid(bone: Bone) -> bool:
    return skin_layer(bone) is not SkinLayer.SKIN


def _is_soft(bone: Bone) -> bool:
    return skin_layer(bone) is not SkinLayer.BONE


def _speck(mass_kg: float) -> Inertia:
    return Inertia(mass_kg, np.zeros(3), np.zeros((3, 3)))


def _rest(bone: Bone) -> Pose:
    return Pose(np.array(bone.origin), bone.rest_rotation)


def _principal_axes(centre: Floats, matrix: Floats) -> Pose:
    """Return the frame in which an inertia is diagonal: Bullet keeps nothing else."""
    if _is_diagonal(matrix):
        return Pose(centre, np.eye(3))
    _, axes = np.linalg.eigh(matrix)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Pose(centre, axes)


def _of_shape(shapes: Sequence[_Shape], axes: Pose, matrix: Floats) -> Pose:
    """Return the frame of the shape if it serves as principal axes, else those there are."""
    for frame in (shape.pose for shape in shapes):
        here = np.allclose(frame.position, axes.position, atol=1e-9)
        if here and _is_diagonal(frame.rotation.T @ matrix @ frame.rotation):
            return frame
    return axes


def _is_diagonal(matrix: Floats) -> bool:
    return bool(np.allclose(matrix, np.diag(np.diag(matrix)), atol=1e-12))


def _inertial(mass_kg: float, axes: Pose, matrix: Floats) -> str:
    x, y, z = np.diag(axes.rotation.T @ matrix @ axes.rotation)
    return (
        f'<inertial>{_origin(axes)}<mass value="{mass_kg!r}"/>'
        f'<inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _bare(bone: Bone, pose: Pose) -> list[_Shape]:
    """Return the rigid primitives of a bone that is at a pose."""
    return [_shape(part, pose) for part in bone.colliders]


def _skinned(bone: Bone, pose: Pose) -> list[_Shape]:
    """Return the primitives of a bone with its skin on."""
    return [_shape(part.grown(bone.skin_thickness_m), pose) for part in bone.colliders]


def _shape(part: Primitive, pose: Pose) -> _Shape:
    centre, turn = part.pose
    place = Pose(pose.position + pose.rotation @ centre, pose.rotation @ turn)
    return _Shape(place, urdf_geometry(part), surface_points(part, pose))


def _singly(layer: _Layer) -> list[_Layer]:
    """Give each shape a link of its own."""
    return [
        _Layer(f"{layer.link}__part{i}" if i else layer.link, [_unturned(shape)], layer.soft)
        for i, shape in enumerate(layer.shapes)
    ]


def _unturned(shape: _Shape) -> _Shape:
    """Turn a shape along its link's z axis into the link's frame: both ends look the same."""
    if abs(shape.pose.rotation[2, 2]) == 1.0:
        return shape._replace(pose=Pose(shape.pose.position, np.eye(3)))
    return shape


def _origin(pose: Pose) -> str:
    angles = _roll_pitch_yaw(pose.rotation)
    return f'<origin xyz="{_numbers(*pose.position)}" rpy="{_numbers(*angles)}"/>'


def _roll_pitch_yaw(r: Floats) -> tuple[float, float, float]:
    """Return a rotation as turns about the fixed axes x, y and z, one after the other, rad."""
    pitch = math.asin(min(max(-r[2, 0], -1.0), 1.0))
    if math.hypot(r[2, 1], r[2, 2]) < _GIMBAL_LOCK:  # x stands upright: roll and yaw are one turn
        return 0.0, pitch, math.atan2(-r[0, 1], r[1, 1])
    return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.12g}" for value in values)

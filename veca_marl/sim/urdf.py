"""The skeleton as URDF text, from which Bullet makes the joint-level body.

Every degree of freedom is a hinge. A bone with three of them hangs on two almost massless links
(`<bone>__0`, `<bone>__1`), which are written before it: Bullet's solver wants parents first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.inertia import Inertia, bone_inertia, joined
from veca_marl.sim.pose import Floats, Pose
from veca_marl.sim.skeleton import Bone, BoneBox, BoneCapsule, Joint, Skeleton
from veca_marl.sim.skin_springs import SkinLayer, is_finger, skin_layer, skin_spring

SKIN_SUFFIX = "__skin"
_LIGHT_SHARE = 0.01  # of its bone's mass, for each link that is not a bone
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


def body_urdf(skeleton: Skeleton, build: Build) -> str:
    """Return the body as a URDF robot.

    Joints are called `<bone>.<label>` as in the table, links as their bones.
    """
    writer = _Writer(skeleton, build)
    parts = [writer.bone(i) for i in range(len(skeleton.bones)) if not writer.is_fixed(i)]
    return '<?xml version="1.0"?>\n<robot name="child">\n' + "\n".join(parts) + "\n</robot>\n"


class _Writer:
    def __init__(self, skeleton: Skeleton, build: Build) -> None:
        self._skeleton = skeleton
        self._build = build

    def is_fixed(self, index: int) -> bool:
        return not self._build.fingers and is_finger(self._skeleton.bones[index])

    def bone(self, index: int) -> str:
        """Write a bone, with what is fixed to it, and all that hangs it on its parent."""
        bone = self._skeleton.bones[index]
        members = self._members(index)
        layer, light = skin_layer(bone), _LIGHT_SHARE * bone.mass_kg
        links = max(bone.joint_count - 1, 0) + (layer is SkinLayer.SKIN_OVER_BONE)
        whole = joined([(pose, bone_inertia(part)) for part, pose in members])
        own = whole._replace(mass_kg=whole.mass_kg - links * light)
        rigid = "".join(_colliders(part, pose, 0.0) for part, pose in members if _is_rigid(part))
        soft = "".join(
            _colliders(part, pose, part.skin_thickness_m)
            for part, pose in members
            if skin_layer(part) is not SkinLayer.BONE
        )
        one_layer = soft if layer is SkinLayer.SKIN else rigid
        text = self._hinges(bone, light)
        text += self._link(bone.name, own, self._rotor(bone), one_layer, bone, layer)
        if layer is SkinLayer.SKIN_OVER_BONE:
            text += self._skin(bone, light, soft)
        return text

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
                text += self._link(child, _speck(light_kg), self._rotor(bone))
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

    def _skin(self, bone: Bone, light_kg: float, shapes: str) -> str:
        name = bone.name + SKIN_SUFFIX
        text = self._link(name, _speck(light_kg), 1e-7, shapes, bone, SkinLayer.SKIN)
        return text + (
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

    def _link(
        self,
        name: str,
        inertia: Inertia,
        rotor: float,
        shapes: str = "",
        bone: Bone | None = None,
        layer: SkinLayer = SkinLayer.BONE,
    ) -> str:
        spring = ""
        if bone is not None and layer is SkinLayer.SKIN:
            skin = skin_spring(bone)
            spring = f'<stiffness value="{skin.stiffness_npm!r}"/>'
            spring += f'<damping value="{skin.damping_nspm!r}"/>'
        friction = f'<lateral_friction value="{self._build.friction!r}"/>'
        return (
            f'<link name="{name}"><contact>{friction}{spring}</contact>'
            f"{_inertial(inertia, rotor)}{shapes}</link>\n"
        )


def _is_rigid(bone: Bone) -> bool:
    return skin_layer(bone) is not SkinLayer.SKIN


def _speck(mass_kg: float) -> Inertia:
    return Inertia(mass_kg, np.zeros(3), np.zeros((3, 3)))


def _rest(bone: Bone) -> Pose:
    return Pose(np.array(bone.origin), bone.rest_rotation)


def _inertial(inertia: Inertia, rotor: float) -> str:
    """Write the inertia along its principal axes: Bullet keeps nothing but a diagonal."""
    matrix = inertia.matrix + rotor * np.eye(3)
    axes = np.eye(3)
    if not np.allclose(matrix, np.diag(np.diag(matrix)), atol=1e-12):
        _, axes = np.linalg.eigh(matrix)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
    x, y, z = np.diag(axes.T @ matrix @ axes)
    return (
        f'<inertial>{_origin(Pose(inertia.centre, axes))}<mass value="{inertia.mass_kg!r}"/>'
        f'<inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _colliders(bone: Bone, pose: Pose, skin_m: float) -> str:
    return "".join(_collider(part, pose, skin_m) for part in bone.colliders)


def _collider(part: BoneCapsule | BoneBox, pose: Pose, skin_m: float) -> str:
    if isinstance(part, BoneBox):
        centre, turn = np.array(part.centre), np.eye(3)
        shape = f'<box size="{_numbers(*(2.0 * (half + skin_m) for half in part.half))}"/>'
    else:
        start, end = np.array(part.start), np.array(part.end)
        length = float(np.linalg.norm(end - start))
        centre, turn = (start + end) / 2.0, along((end - start) / length)
        shape = f'<capsule radius="{part.radius + skin_m:.9g}" length="{length:.9g}"/>'
    place = Pose(pose.position + pose.rotation @ centre, pose.rotation @ turn)
    return f"<collision>{_origin(place)}<geometry>{shape}</geometry></collision>"


def along(axis: Floats) -> Floats:
    """Return a rotation ``(3, 3)`` whose z axis is `axis`, a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _origin(pose: Pose) -> str:
    r = pose.rotation
    pitch = math.asin(min(max(-r[2, 0], -1.0), 1.0))
    angles = (math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0]))
    return f'<origin xyz="{_numbers(*pose.position)}" rpy="{_numbers(*angles)}"/>'


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.12g}" for value in values)

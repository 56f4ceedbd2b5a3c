"""The skeleton as a robot that Bullet reads: URDF text and files of convex hulls.

Every degree of freedom is a hinge. A bone with three of them hangs on two almost massless links
(``<bone>__0``, ``<bone>__1``), which are written before it: Bullet's solver requires parents first.

With fingers no link has more than one shape; further ones have links of their own
(``<bone>__part1``). The order in which Bullet solves the contacts of two shapes of one link depends
on earlier episodes. A single shape is used as it is if its frame is that of the link's inertia;
otherwise Bullet wraps it in a compound, which is slower and finds contacts only inside the bounding
box. Without fingers a hand has up to 16 shapes, too many for links of their own: there the shapes
of a link are replaced by their hull, and the thumb has a hull of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.link_shapes import (
    Layer,
    LinkShape,
    SkinLayer,
    as_obj,
    axes_of_shape,
    collision_element,
    inertial_element,
    is_finger,
    numbers,
    one_link_per_shape,
    origin_element,
    principal_axes,
    rigid_shapes,
    skin_layer,
    skin_spring,
    soft_shapes,
)
from veca_marl.sim.body.anatomy.skeleton import Bone, Joint, Skeleton
from veca_marl.sim.geometry import Floats, Inertia, Pose, joined_inertia

SKIN_SUFFIX, THUMB_SUFFIX = "__skin", "__thumb"
_TIPS = ("forearm", "hand", "foot", "neck", "head")  # bones with light links or short levers
_LIGHT_SHARE = 0.01  # of the mass of its bone, for each link that is not a bone
_IDENTITY = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class Build:
    """Options of the conversion of the skeleton to a multibody.

    Attributes:
        fingers: Whether the fingers move; if not, they are straight and fixed to the hand.
        strength: Factor of the torques in the table.
        free_speed_radps: Speed at which the damping of a joint equals its full torque.
        finger_rotor_s: Ratio of the isotropic inertia that is added to each link of a finger to the
            damping of its joints. Contacts act on the inertia alone, dampers in the next step:
            without it light links oscillate at contacts.
        tip_rotor_s: The same for forearms, hands, feet, neck and head.
        auxiliary_share: Moment of inertia of each auxiliary link of a bone with several hinges, as
            a share of the least one of the bone; the bone has the remainder.
        friction: Lateral friction of the skin.
    """

    fingers: bool = True
    strength: float = 1.0
    free_speed_radps: float = 20.0
    finger_rotor_s: float = 0.006
    tip_rotor_s: float = 0.001
    auxiliary_share: float = 0.3
    friction: float = 0.8


def bone_of(link: str) -> str:
    """Return the bone that a link with a shape belongs to; its own name for a link without."""
    bone, _, rest = link.partition("__")
    return link if rest.isdigit() else bone


class BodyFiles(NamedTuple):
    """The files of a body for Bullet.

    Attributes:
        urdf: Text of the robot.
        hulls: Names and texts of the files that it refers to.
    """

    urdf: str
    hulls: Mapping[str, str]


@lru_cache(maxsize=8)  # worlds have bodies of few builds, and the text takes half of the loading
def body_files(skeleton: Skeleton, build: Build) -> BodyFiles:
    """Return the body as a URDF robot.

    Joints are named ``<bone>.<label>`` as in the table, links as their bones. Repeated calls with
    the same skeleton and an equal build return the same object.
    """
    writer = _Writer(skeleton, build)
    parts = [writer.bone(i) for i in range(len(skeleton.bones)) if not writer.is_fixed(i)]
    text = '<?xml version="1.0"?>\n<robot name="child">\n' + "\n".join(parts) + "\n</robot>\n"
    return BodyFiles(text, writer.hulls)


class _Writer:
    """Writes the links and joints of a skeleton; `hulls` collects the files they refer to."""

    def __init__(self, skeleton: Skeleton, build: Build) -> None:
        self._skeleton = skeleton
        self._build = build
        self.hulls: dict[str, str] = {}

    def is_fixed(self, index: int) -> bool:
        """Return whether a bone is fixed to its parent."""
        return not self._build.fingers and is_finger(self._skeleton.bones[index])

    def bone(self, index: int) -> str:
        """Return the links of a bone, with the bones fixed to it, and the joints to its parent."""
        bone = self._skeleton.bones[index]
        members = self._members(index)
        layers, light = self._layers(bone, members), _LIGHT_SHARE * bone.mass_kg
        links = max(bone.joint_count - 1, 0) + len(layers) - 1
        whole = joined_inertia([(pose, part.inertia()) for part, pose in members])
        auxiliary = max(bone.joint_count - 1, 0)
        moment = self._auxiliary_moment(whole.matrix, auxiliary)
        remainder = whole.matrix - auxiliary * moment * np.eye(3)
        own = whole._replace(mass_kg=whole.mass_kg - links * light, matrix=remainder)
        text = self._hinges(bone, light, moment)
        text += self._link(layers[0], own, self._rotor(bone), bone)
        return text + "".join(self._fixed(layer, light, bone) for layer in layers[1:])

    def _auxiliary_moment(self, matrix: Floats, links: int) -> float:
        """Return the moment of inertia of each auxiliary link of a bone, kg m^2.

        The remainder must satisfy the triangle inequality of moments: otherwise Bullet sets all
        moments of the bone to 0.
        """
        moments = np.linalg.eigvalsh(matrix)
        slack = 0.9 * (moments[0] + moments[1] - moments[2]) / max(links, 1)
        return float(min(self._build.auxiliary_share * moments[0], slack))

    def _layers(self, bone: Bone, members: list[tuple[Bone, Pose]]) -> list[Layer]:
        """Return the links of a bone that have shapes; the first is the bone itself."""
        layer = skin_layer(bone)
        rigid = [
            shape for part, pose in members if _is_rigid(part) for shape in rigid_shapes(part, pose)
        ]
        soft, thumb = (
            [
                shape
                for part, pose in members
                if _is_soft(part) and _is_thumb_on(bone, part) is of_thumb
                for shape in soft_shapes(part, pose)
            ]
            for of_thumb in (False, True)
        )
        layers = [Layer(bone.name, rigid, soft=False)]
        if layer is SkinLayer.SKIN:
            layers = [Layer(bone.name, soft, soft=True)]
        elif layer is SkinLayer.SKIN_OVER_BONE:
            layers.append(Layer(bone.name + SKIN_SUFFIX, soft, soft=True))
        if thumb:
            layers.append(Layer(bone.name + THUMB_SUFFIX, thumb, soft=True))
        if self._build.fingers:
            return [one for layer in layers for one in one_link_per_shape(layer)]
        return [self._with_hull(layer) for layer in layers]

    def _with_hull(self, layer: Layer) -> Layer:
        """Replace the shapes of a link by their hull."""
        if len(layer.shapes) < 2:
            return layer
        points = np.concatenate([shape.points for shape in layer.shapes])
        file = f"{layer.link}.obj"
        self.hulls[file] = as_obj(points)
        return layer._replace(shapes=[LinkShape(_IDENTITY, f'<mesh filename="{file}"/>', points)])

    def _members(self, index: int) -> list[tuple[Bone, Pose]]:
        """Return a bone and those fixed to it, with their poses in its frame."""
        bones = self._skeleton.bones
        poses = {index: _IDENTITY}
        for child in range(index + 1, len(bones)):
            if self.is_fixed(child) and bones[child].parent in poses:
                up = poses[bones[child].parent]
                place = up.position + up.rotation @ np.array(bones[child].origin)
                poses[child] = Pose(place, up.rotation @ bones[child].rest_rotation)
        return [(bones[member], pose) for member, pose in poses.items()]

    def _hinges(self, bone: Bone, light_kg: float, moment: float) -> str:
        if bone.parent < 0:
            return ""
        parent, origin = self._skeleton.bones[bone.parent].name, origin_element(_rest(bone))
        text = ""
        for step in range(bone.joint_count):
            last = step == bone.joint_count - 1
            child = bone.name if last else f"{bone.name}__{step}"
            if not last:
                empty = Layer(child, (), soft=False)
                inertia = _point_mass(light_kg)._replace(matrix=moment * np.eye(3))
                text += self._link(empty, inertia, self._rotor(bone))
            joint = self._skeleton.joints[bone.first_joint + step]
            text += (
                f'<joint name="{joint.bone}.{joint.label}" type="revolute">'
                f'<parent link="{parent}"/><child link="{child}"/>{origin}'
                f'<axis xyz="{numbers(*joint.axis)}"/>'
                f'<limit lower="{joint.low_rad!r}" upper="{joint.high_rad!r}" '
                f'effort="{self._torque(joint)!r}" velocity="100"/>'
                f'<dynamics damping="{self._torque(joint) / self._build.free_speed_radps!r}"/>'
                "</joint>\n"
            )
            parent, origin = child, origin_element(_IDENTITY)
        return text

    def _fixed(self, layer: Layer, light_kg: float, bone: Bone) -> str:
        """Return a light link that is fixed to that of the bone."""
        name, centre = layer.link, layer.shapes[0].pose.position
        inertia = _point_mass(light_kg)._replace(centre=centre)
        return self._link(layer, inertia, 1e-7, bone) + (
            f'<joint name="{name}" type="fixed"><parent link="{bone.name}"/>'
            f'<child link="{name}"/></joint>\n'
        )

    def _rotor(self, bone: Bone) -> float:
        """Return the inertia added to the links of a bone, as of the rotors of motors, kg m^2."""
        if not (is_finger(bone) or bone.name.endswith(_TIPS)):
            return 0.0
        joints = self._skeleton.joints[bone.first_joint : bone.first_joint + bone.joint_count]
        damping = max(map(self._torque, joints)) / self._build.free_speed_radps
        time_s = self._build.finger_rotor_s if is_finger(bone) else self._build.tip_rotor_s
        return damping * time_s

    def _torque(self, joint: Joint) -> float:
        return self._build.strength * joint.torque_nm

    def _link(self, layer: Layer, inertia: Inertia, rotor: float, bone: Bone | None = None) -> str:
        spring = ""
        if bone is not None and layer.soft:
            skin = skin_spring(bone)
            spring = f'<stiffness value="{skin.stiffness_npm!r}"/>'
            spring += f'<damping value="{skin.damping_nspm!r}"/>'
        friction = f'<lateral_friction value="{self._build.friction!r}"/>'
        shapes = "".join(map(collision_element, layer.shapes))
        matrix = inertia.matrix + rotor * np.eye(3)
        axes = principal_axes(inertia.centre, matrix)
        # the inertial frame of the base stays simple: Bullet reports base poses relative to it
        if self._build.fingers and layer.link != self._skeleton.bones[0].name:
            axes = axes_of_shape((shape.pose for shape in layer.shapes), axes, matrix)
        return (
            f'<link name="{layer.link}"><contact>{friction}{spring}</contact>'
            f"{inertial_element(inertia.mass_kg, axes, matrix)}{shapes}</link>\n"
        )


def _is_thumb_on(hand: Bone, part: Bone) -> bool:
    """Whether a bone is of a thumb fixed to a hand, which has a hull apart from the palm's."""
    return part is not hand and "_thumb_" in part.name


def _is_rigid(bone: Bone) -> bool:
    return skin_layer(bone) is not SkinLayer.SKIN


def _is_soft(bone: Bone) -> bool:
    return skin_layer(bone) is not SkinLayer.BONE


def _point_mass(mass_kg: float) -> Inertia:
    return Inertia(mass_kg, np.zeros(3), np.zeros((3, 3)))


def _rest(bone: Bone) -> Pose:
    return Pose(np.array(bone.origin), bone.rest_rotation)

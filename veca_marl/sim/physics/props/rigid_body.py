"""The body of a prop in Bullet: its shape, mass, inertia, friction, restitution and pose."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from veca_marl.sim.geometry import (
    Floats,
    Geom,
    Inertia,
    Pose,
    Primitive,
    joined_inertia,
    matrix_to_quaternion,
    primitive_inertia,
)
from veca_marl.sim.physics.bullet import create_collision_shape, unused_visual_shape
from veca_marl.sim.physics.bullet_client import BulletClient, Quaternion, Vector, pybullet
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.props.joint import LINK, Joint, JointCfg, JointKind
from veca_marl.sim.physics.props.prop_cfg import PropCfg, PropShape

_STEP_S = 0.008  # physics step at which `contact_share` is used as it is
_ROUNDING = 1e-9  # of products of inertia, relative to the moments
_SEVERAL_LINKS = (PropShape.doll, PropShape.compound)
_SPACER = LINK - 1
_JOINTS = {JointKind.hinge: pybullet.JOINT_REVOLUTE, JointKind.slide: pybullet.JOINT_PRISMATIC}
_EXACT_IN_BULLET = (PropShape.sphere, PropShape.box, PropShape.cylinder)


def create_prop_body(
    cfg: PropCfg, client: BulletClient, geoms: Sequence[Primitive]
) -> tuple[int, Pose]:
    """Create the rigid body of a prop, with its frame at the origin.

    Args:
        cfg: The prop.
        client: The PyBullet client.
        geoms: Its primitives, in its frame.

    Returns:
        PyBullet's id, and the inertial frame on the frame of the prop, see `inertial_frame`.
    """
    inertia = None if cfg.mass_kg == 0.0 else prop_inertia(geoms, cfg.mass_kg)
    frame, moments = inertial_frame(inertia)
    shapes = _collision_shapes(cfg, client, [_on_frame(geom, frame) for geom in geoms])
    visual = unused_visual_shape(client, geoms)
    body_id: int = client.createMultiBody(
        cfg.mass_kg,
        shapes[0],
        visual,
        basePosition=frame.position.tolist(),
        baseOrientation=matrix_to_quaternion(frame.rotation).tolist(),
        **_links([_welded(shape, parent=-1) for shape in shapes[1:]], visual),
    )
    client.changeDynamics(body_id, -1, **prop_dynamics(cfg, moments))
    _prepare_links(body_id, 0, len(shapes) - 1, cfg, client)
    if not cfg.tangible:
        client.setCollisionFilterGroupMask(body_id, -1, 0, 0)
    return body_id, frame


def create_attached_body(
    cfg: PropCfg, joint: JointCfg, client: BulletClient, geoms: Sequence[Primitive]
) -> tuple[int, Pose]:
    """Create the body of a prop with a joint: a fixed base, a spacer, and the link that moves.

    Base and spacer have no shape. They are at the anchor of the joint, with the axes of the closed
    prop. Bullet takes a link that is fixed to link 0 of a fixed base for a static one, whatever the
    joint of link 0 is: further shapes would pass through fixed props and walkers. The spacer is
    link 0 instead.

    Args:
        cfg: The prop.
        joint: Its joint.
        client: The PyBullet client.
        geoms: Its primitives, in its frame.

    Returns:
        As `create_prop_body`.
    """
    frame, moments = inertial_frame(prop_inertia(geoms, cfg.mass_kg))
    anchor, axis = np.asarray(joint.anchor_m, np.float64), np.asarray(joint.axis, np.float64)
    at_anchor = Pose(anchor, np.eye(3))
    shapes = _collision_shapes(cfg, client, [_on_frame(geom, at_anchor) for geom in geoms])
    visual = unused_visual_shape(client, geoms)
    leaf = _Link(
        shapes[0],
        parent=_SPACER,
        mass_kg=cfg.mass_kg,
        centre=frame.position - anchor,
        axes=frame.rotation,
        joint=_JOINTS[joint.kind],
        axis=axis / np.linalg.norm(axis),
    )
    spacer = _Link(shape=-1)
    body_id: int = client.createMultiBody(
        baseMass=0.0,
        basePosition=anchor.tolist(),
        **_links([spacer, leaf, *(_welded(shape, parent=LINK) for shape in shapes[1:])], visual),
    )
    dynamics = prop_dynamics(cfg, moments)
    if moments is not None:
        dynamics["localInertiaDiagonal"] = moments.tolist()
    client.changeDynamics(body_id, LINK, **dynamics)
    _prepare_links(body_id, LINK + 1, LINK + len(shapes), cfg, client)
    return body_id, frame


def inertial_frame(inertia: Inertia | None) -> tuple[Pose, Floats | None]:
    """Return the pose of the principal axes of inertia, and the moments about them.

    Bullet uses the inertia of the bounding box for capsules, hulls and several primitives at once,
    and takes the axes of the body as principal axes and their origin as the centre of mass.
    Poses of the body in Bullet are therefore those of its inertial frame.

    Args:
        inertia: Of the prop in its frame; None for a fixed prop; its own frame is returned.

    Returns:
        The pose, its rotation the identity where the axes of the prop are principal axes, and the
        moments ``(3,)`` in kg m^2; None for a fixed prop.
    """
    if inertia is None:
        return Pose(np.zeros(3), np.eye(3)), None
    moments = np.diag(inertia.matrix)
    if np.abs(inertia.matrix - np.diag(moments)).max() <= _ROUNDING * moments.max():
        return Pose(inertia.centre, np.eye(3)), moments
    moments, axes = np.linalg.eigh(inertia.matrix)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])  # right-handed
    return Pose(inertia.centre, axes), moments


@dataclass(frozen=True, eq=False)
class _Link:
    """One link of a multibody, as PyBullet's `createMultiBody` takes it.

    Attributes:
        shape: Id of its collision shape.
        parent: Index of the link that it is attached to; -1 is the base.
        mass_kg: Its mass.
        centre: ``(3,)`` metres, its inertial frame on its own frame.
        axes: ``(3, 3)`` rotation of the inertial frame.
        joint: PyBullet's type of joint.
        axis: ``(3,)`` axis of the joint.
    """

    shape: int
    parent: int = -1
    mass_kg: float = 0.0
    centre: Floats = field(default_factory=lambda: np.zeros(3))
    axes: Floats = field(default_factory=lambda: np.eye(3))
    joint: int = pybullet.JOINT_FIXED
    axis: Floats = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))


def _welded(shape: int, parent: int) -> _Link:
    """Return a link without mass that is fixed to another: a further shape of the same body.

    A movable body with its shapes on different links has one manifold of contacts for each of
    them, in the order of the links. With several shapes on one link the order depends on earlier
    episodes, and a reset would not restore the built state bit by bit. Fixed bodies have no such
    fault, and one link: 30 pieces of furniture of 6 parts take a quarter of the time of 180 boxes.
    """
    return _Link(shape, parent)


def _links(links: Sequence[_Link], visual: int) -> dict[str, Any]:
    """Return the arguments of `createMultiBody` for links that share the frame of their base."""
    if not links:
        return {}
    identity = (0.0, 0.0, 0.0, 1.0)
    return {
        "linkMasses": [link.mass_kg for link in links],
        "linkCollisionShapeIndices": [link.shape for link in links],
        "linkVisualShapeIndices": [visual] * len(links),
        "linkPositions": [(0.0, 0.0, 0.0)] * len(links),
        "linkOrientations": [identity] * len(links),
        "linkInertialFramePositions": [link.centre.tolist() for link in links],
        "linkInertialFrameOrientations": [
            matrix_to_quaternion(link.axes).tolist() for link in links
        ],
        "linkParentIndices": [link.parent + 1 for link in links],
        "linkJointTypes": [link.joint for link in links],
        "linkJointAxis": [link.axis.tolist() for link in links],
    }


def _collision_shapes(cfg: PropCfg, client: BulletClient, geoms: Sequence[Primitive]) -> list[int]:
    """Return the collision shapes of a prop, one for each link; see `_welded`."""
    if cfg.shape in _SEVERAL_LINKS and cfg.mass_kg > 0.0:
        return [create_collision_shape(client, [geom]) for geom in geoms]
    return [create_collision_shape(client, geoms)]


def _prepare_links(body_id: int, first: int, end: int, cfg: PropCfg, client: BulletClient) -> None:
    """Set the dynamics of the links `first` to `end` - 1, which have no mass."""
    for link in range(first, end):
        client.changeDynamics(body_id, link, **prop_dynamics(cfg, None))


def _on_frame(geom: Primitive, frame: Pose) -> Primitive:
    """Return a primitive on an inertial frame instead of the frame of the prop."""
    offset = np.asarray(geom.offset)
    if frame.position.any():
        offset = offset - frame.position
    if is_turned(frame):
        offset = frame.rotation.T @ offset
        geom = replace(geom, rotation=frame.rotation.T @ np.asarray(geom.rotation))
    return replace(geom, offset=offset)


def is_turned(frame: Pose) -> bool:
    """Return whether the rotation of a frame is not exactly the identity."""
    return not np.array_equal(frame.rotation, np.eye(3))


def limit_detection(
    body_id: int, links: Iterable[int], cfg: PropCfg, client: BulletClient, clock: ClockCfg
) -> None:
    """Limit how far ahead a movable prop with restitution has contacts at short physics steps.

    Bullet subtracts the distance to a contact over the time step from the speed of rebound: at a
    constant distance a ball would rebound less, the shorter the step. Steps of 8 ms and more need
    no limit.
    """
    shortening = clock.substep_s / _STEP_S
    if cfg.mass_kg == 0.0 or cfg.restitution == 0.0 or shortening >= 1.0:
        return
    for link in links:
        low, high = client.getAABB(body_id, link)
        size = float(np.linalg.norm(np.subtract(high, low))) / 2.0
        client.changeDynamics(
            body_id, link, contactProcessingThreshold=clock.contact_share * shortening * size
        )


def prop_inertia(geoms: Sequence[Primitive], mass_kg: float) -> Inertia:
    """Return the inertia of primitives of one density, in the frame that they are on.

    A volume in which primitives overlap counts for each of them.
    """
    volumes = np.array([geom.volume for geom in geoms])
    masses = mass_kg * volumes / volumes.sum()
    here = Pose(np.zeros(3), np.eye(3))
    parts = [
        (here, primitive_inertia(geom, float(mass)))
        for geom, mass in zip(geoms, masses, strict=True)
    ]
    return joined_inertia(parts)


def prop_dynamics(cfg: PropCfg, moments: Floats | None) -> dict[str, Any]:
    """Return the arguments of PyBullet's `changeDynamics`.

    Args:
        cfg: The prop.
        moments: ``(3,)`` kg m^2, principal moments of inertia; None for a fixed prop.
    """
    arguments: dict[str, Any] = {
        "lateralFriction": cfg.friction,
        "rollingFriction": cfg.rolling_friction,
        "spinningFriction": cfg.rolling_friction,
        "restitution": cfg.restitution,
        "linearDamping": 0.0,
        "angularDamping": 0.0,  # only friction slows objects down
    }
    if moments is not None and cfg.shape not in _EXACT_IN_BULLET:
        arguments["localInertiaDiagonal"] = moments.tolist()
    return arguments


def create_body(
    cfg: PropCfg, client: BulletClient, geoms: Sequence[Geom]
) -> tuple[int, int, Joint | None, Pose]:
    """Create the body of a prop; return its id and link, its joint and its inertial frame."""
    if cfg.joint is None:
        body_id, frame = create_prop_body(cfg, client, geoms)
        return body_id, -1, None, frame
    body_id, frame = create_attached_body(cfg, cfg.joint, client, geoms)
    return body_id, LINK, Joint(cfg.joint, body_id, client), frame


def pose_reader(
    body_id: int, link: int, client: BulletClient
) -> Callable[[], tuple[Vector, Quaternion]]:
    """Return a function that reads position and quaternion of the inertial frame."""
    if link == -1:
        return partial(client.getBasePositionAndOrientation, body_id)

    def read() -> tuple[Vector, Quaternion]:
        state = client.getLinkState(body_id, link, computeForwardKinematics=1)
        return state.centre, state.centre_orientation

    return read

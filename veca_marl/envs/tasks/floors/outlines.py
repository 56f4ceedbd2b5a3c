"""Outlines of bodies as they start: what a task compares its distances with before it has a world.

An outline is a set of spheres ``(n, 4)``, centre and radius in metres, in place of the colliders of
a body: of a joint-level body on hands and knees, of a walker upright. The pelvis is above the
origin, the floor at 0, and the body heads along x. Capsules are rows of spheres, hands and feet
have the spheres about their boxes; the error is a few millimetres.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np

from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.anatomy import Bone, Growth, forward_kinematics, load_skeleton
from veca_marl.sim.body.anatomy.link_shapes import SkinLayer, skin_layer
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS, pelvis_rotation, posture_angles
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.body.walker.walker_cfg import sized
from veca_marl.sim.geometry import Floats, Primitive, Shape, distances_to
from veca_marl.sim.physics import PlannedProp

_STEP = 0.4  # distance of the spheres of a capsule, in radii: their hollows are 2 % of these
_MOST_SPHERES = 1000  # of a capsule
_TOUCHING_M = 1e-4
_ADVANCES = 200
_SIDES = 8  # of a body, with which it can touch a thing


def start_outline(cfg: BodyCfg) -> Floats:
    """Return the outline of a body as `place_player` places it; it must not be changed.

    Args:
        cfg: Parameters of the body. Kinds that are not in this package have no spheres.
    """
    if isinstance(cfg, HumanoidCfg):
        return _crawling(cfg.growth)
    if isinstance(cfg, WalkerCfg):
        own = sized(cfg)
        return _upright(own.radius_m, own.capsule_height_m)
    return np.zeros((0, 4))


@functools.cache
def _crawling(growth: Growth) -> Floats:
    skeleton = load_skeleton(growth)
    count = len(skeleton.bones)
    positions, rotations = np.zeros((count, 3)), np.zeros((count, 3, 3))
    rotations[0] = pelvis_rotation(ON_ALL_FOURS, 0.0)
    angles = posture_angles(skeleton, ON_ALL_FOURS)
    forward_kinematics(skeleton, angles, positions, rotations)
    spheres = []
    for number, bone in enumerate(skeleton.bones):
        own = np.concatenate([_spheres(part) for part in _colliders(bone)])
        own[:, :3] = positions[number] + own[:, :3] @ rotations[number].T
        spheres.append(own)
    outline = np.concatenate(spheres)
    outline[:, 2] -= (outline[:, 2] - outline[:, 3]).min()
    return outline


def _colliders(bone: Bone) -> list[Primitive]:
    """Return what a bone collides with: with its skin where that is compliant."""
    skin_m = 0.0 if skin_layer(bone) is SkinLayer.BONE else bone.skin_thickness_m
    return [part.grown(skin_m) for part in bone.colliders]


def _spheres(part: Primitive) -> Floats:
    if part.shape is Shape.BOX:
        return np.array([[*part.pose.position, math.hypot(*part.size)]])
    low, high = part.cap_centres()
    count = 2 + int(np.linalg.norm(high - low) / (_STEP * part.radius))
    return np.column_stack([np.linspace(low, high, count), np.full(count, part.radius)])


@functools.cache
def _upright(radius_m: float, height_m: float) -> Floats:
    highest_m = max(height_m - radius_m, radius_m)
    count = 2 + min(int((highest_m - radius_m) / (_STEP * radius_m)), _MOST_SPHERES)
    heights, zero = np.linspace(radius_m, highest_m, count), np.zeros(count)
    return np.column_stack([zero, zero, heights, np.full(len(heights), radius_m)])


def placed(outline: Floats, place: Floats, heading_rad: float) -> Floats:
    """Return an outline with the pelvis above ``(2,)`` metres of the floor, and a heading."""
    (x, y), cos, sin = outline[:, :2].T, math.cos(heading_rad), math.sin(heading_rad)
    plan = np.column_stack([place[0] + cos * x - sin * y, place[1] + sin * x + cos * y])
    return np.column_stack([plan, outline[:, 2:]])


def outlines_overlap(one: Floats, other: Floats) -> bool:
    """Return whether two placed outlines overlap."""
    one = _near(one, other)
    other = _near(other, one)
    one = _near(one, other)
    offsets = one[:, None, :3] - other[None, :, :3]
    both_m = one[:, None, 3] + other[None, :, 3]
    return bool((np.einsum("ijk,ijk->ij", offsets, offsets) < both_m**2).any())


def _near(outline: Floats, other: Floats) -> Floats:
    """Return the spheres of an outline that overlap the bounding box of another one."""
    if not len(other):
        return outline[:0]
    low = (other[:, :3] - other[:, 3:]).min(axis=0)
    high = (other[:, :3] + other[:, 3:]).max(axis=0)
    centres, radii = outline[:, :3], outline[:, 3:]
    near: Floats = outline[((centres + radii > low) & (centres - radii < high)).all(axis=1)]
    return near


def farthest_back_m(outline: Floats, spread_rad: float) -> float:
    """Return how far a body reaches behind its pelvis.

    Args:
        outline: The outline.
        spread_rad: Greatest angle by which the body is turned to either side.
    """
    along = np.hypot(outline[:, 0], outline[:, 1])
    aside_rad = np.abs(np.arctan2(outline[:, 1], -outline[:, 0]))
    behind = along * np.cos(np.maximum(aside_rad - spread_rad, 0.0)) + outline[:, 3]
    return float(behind.max(initial=0.0))


def check_reach(reach_m: float, thing: PlannedProp, bodies: Mapping[str, BodyCfg]) -> None:
    """Check that a body touching a thing, with whichever side, has reached it.

    Args:
        reach_m: Distance of the pelvis from the surface of the thing, as measured by `gap_m`.
        thing: A thing that stands on the floor; its middle is at the origin of the floor plan.
        bodies: Bodies by team name.

    Raises:
        ValueError: If the thing itself keeps a body from being so near.
    """
    for team, body in bodies.items():
        least_m = math.inf
        for heading_rad in np.linspace(0.0, 2.0 * math.pi, _SIDES, endpoint=False):
            outline = placed(start_outline(body), np.zeros(2), float(heading_rad))
            least_m = min(least_m, least_gap_m(outline, thing))
            if least_m <= reach_m:
                break
        else:
            raise ValueError(
                f"{team}: task.reach_m={reach_m:g} cannot be reached by a body "
                f"{body.growth.height_m:.3g} m high: its middle comes within {least_m:.3f} m of "
                "the object when they touch; choose a greater one"
            )


def least_gap_m(outline: Floats, thing: PlannedProp) -> float:
    """Return how near the origin of an outline gets to a thing when they move together along x.

    The gap is measured as by `gap_m`. The body stays in its posture.

    Args:
        outline: The outline.
        thing: A thing that stands on the floor; its middle is at the origin of the floor plan.
    """
    if not len(outline):
        return -math.inf
    centres = outline[:, :3].copy()
    away_m = float((outline[:, 0] + outline[:, 3]).max()) + thing.reach_m
    centres[:, 0] -= away_m
    for _ in range(_ADVANCES):
        own = (centres - thing.position) @ thing.rotation
        nearest = np.min([distances_to(geom, own) for geom in thing.geoms], axis=0)
        gap_m = float((nearest - outline[:, 3]).min())
        if gap_m < _TOUCHING_M or away_m < 0.0:
            break
        centres[:, 0] += gap_m
        away_m -= gap_m
    return away_m - thing.radius_m

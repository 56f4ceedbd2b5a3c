"""Measures how far the stored mesh is from the felt skin: by age, and in bent poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tools.make_skin.fit import FeltSkin
from veca_marl.sim.body.anatomy import (
    REFERENCE,
    Skeleton,
    binding_pose,
    forward_kinematics,
    growth_at,
    load_skeleton,
    load_skin,
)
from veca_marl.sim.geometry import Floats, deform_meshes, empty_meshes, with_mesh
from veca_marl.sim.touch.taxels import BARYCENTRIC

_AGES, _POSES = (1.0, 4.0, 8.0, 18.0, 36.0), 100
_WIDE_M = 0.002


def measured() -> Iterator[str]:
    """Yield lines with the absolute distances of the taxels that are not inside another limb."""
    yield _line("body of 0.78 m", _heights(load_skeleton(), *binding_pose(load_skeleton())))
    for age in _AGES:
        skeleton = load_skeleton(growth_at(age))
        yield _line(f"{age:g} months", _heights(skeleton, *binding_pose(skeleton)))
    for share in (0.5, 1.0):
        heights = [_heights(load_skeleton(), *pose) for pose in _random_poses(share)]
        yield _line(f"random poses, {share:g} of the joint ranges", np.concatenate(heights))


def _line(what: str, heights: Floats) -> str:
    apart_mm = 1e3 * np.abs(heights)
    wide = np.mean(np.abs(heights) > _WIDE_M)
    p50, p90, p99, most = np.percentile(apart_mm, [50, 90, 99, 100])
    return (
        f"{what}: median {p50:.1f} mm, 90 % {p90:.1f}, 99 % {p99:.1f}, all {most:.1f}; "
        f"above 2 mm {100 * wide:.1f} %"
    )


def _heights(skeleton: Skeleton, positions: Floats, rotations: Floats) -> Floats:
    """Return metres ``(n,)`` of the seen taxels above the felt skin of their limbs."""
    mesh, felt = load_skin(skeleton.growth), FeltSkin(skeleton, positions, rotations)
    posed = with_mesh(empty_meshes(), mesh, 0)
    deform_meshes(posed, positions, rotations)
    points = np.einsum("bk,tkc->tbc", BARYCENTRIC, posed.vertices[mesh.triangles]).reshape(-1, 3)
    bones = np.repeat(mesh.owners, len(BARYCENTRIC))
    heights: Floats = felt.own(bones, points)[~felt.hidden(bones, points)]
    return heights


def _random_poses(share: float) -> Iterator[tuple[Floats, Floats]]:
    """Yield positions and rotations of the bones with joints in a share of their ranges."""
    skeleton, rng = load_skeleton(REFERENCE), np.random.default_rng(0)
    low, high = (
        np.array([getattr(j, e) for j in skeleton.joints]) for e in ("low_rad", "high_rad")
    )
    for _ in range(_POSES):
        positions, rotations = np.zeros((47, 3)), np.tile(np.eye(3), (47, 1, 1))
        forward_kinematics(skeleton, share * rng.uniform(low, high), positions, rotations)
        yield positions, rotations

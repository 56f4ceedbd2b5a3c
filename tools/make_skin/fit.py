"""The fit of the mesh to the felt skin: the surface of the bones' primitives with the skin on.

The taxels of the binding pose shall lie on the felt skin of their own limb, as limbs move against
each other. Chords cut through curved skin, so that vertices end a little outside of it and the
middles of triangles a little inside. The largest errors count: the weight of a taxel grows while
its error is above what is tolerated (after Lawson's algorithm for minimax fits).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from tools.make_skin.loft import Loft
from veca_marl.sim.body.anatomy import Skeleton, binding_pose
from veca_marl.sim.geometry import Bools, Floats, Indices
from veca_marl.sim.touch.taxels import BARYCENTRIC, distance_to_bone

_HIDDEN_M = 0.002  # depth in another limb from which a taxel is not seen
_ITERATIONS, _STEP_M = 300, 0.002
# weights of the squares of shifts: less the mean shift of the neighbours, and as they are; that of
# the error of a taxel is from 1 to the greatest, and grows while the error is not tolerated
_SMOOTH, _STAY = 0.7, 0.03
_GREATEST_WEIGHT, _TOLERATED_M = 80.0, 0.0013


def limb_of(bone: str) -> str:
    """Return the limb of a bone: `trunk`, `l_arm`, `l_leg`, `l_thumb` and so on."""
    side, _, part = bone.partition("_")
    if side not in ("l", "r"):
        return "trunk"
    first = part.partition("_")[0]
    limbs = {"upper": "arm", "forearm": "arm", "hand": "arm"}
    limbs |= {"thigh": "leg", "shank": "leg"}
    return f"{side}_{limbs.get(first, first)}"


class FeltSkin:
    """Distances to the felt skin of the limbs.

    Args:
        skeleton: The bones.
        positions: ``(47, 3)`` metres, where they are.
        rotations: ``(47, 3, 3)``.
    """

    def __init__(self, skeleton: Skeleton, positions: Floats, rotations: Floats) -> None:
        self._skeleton, self._positions, self._rotations = skeleton, positions, rotations
        names = [limb_of(bone.name) for bone in skeleton.bones]
        self._limbs = [[i for i, name in enumerate(names) if name == limb] for limb in set(names)]

    def own(self, bones: Indices, points: Floats) -> Floats:
        """Return metres ``(n,)`` above the skin of each point's own limb, negative inside.

        Args:
            bones: ``(n,)`` a bone of the limb of each point.
            points: ``(n, 3)`` metres.
        """
        found = np.zeros(len(points))
        for limb in self._limbs:
            mine = np.isin(bones, limb)
            found[mine] = self._to_limb(limb, points[mine])
        return found

    def gradient(self, bones: Indices, points: Floats) -> Floats:
        """Return the gradient ``(n, 3)`` of `own`."""
        step = 1e-6
        return np.stack(
            [
                (self.own(bones, points + way) - self.own(bones, points - way)) / (2.0 * step)
                for way in step * np.eye(3)
            ],
            axis=1,
        )

    def hidden(self, bones: Indices, points: Floats) -> Bools:
        """Return a mask ``(n,)`` of the points that are inside another limb."""
        found = np.zeros(len(points), bool)
        for limb in self._limbs:
            other = ~np.isin(bones, limb)
            found[other] |= self._to_limb(limb, points[other]) < -_HIDDEN_M
        return found

    def _to_limb(self, limb: list[int], points: Floats) -> Floats:
        nearest = np.full(len(points), np.inf)
        for index in limb:
            bone = self._skeleton.bones[index]
            local = (points - self._positions[index]) @ self._rotations[index]
            nearest = np.minimum(nearest, distance_to_bone(bone, local) - bone.skin_thickness_m)
        return nearest


@dataclass
class Problem:
    """The linear maps of the fit.

    Attributes:
        free: ``(3 V, q)`` the coordinates of the vertices of trunk and left side, from free ones.
        start: ``(3 V,)`` metres, the coordinates of the loft in the binding pose.
        taxels: ``(3 T, 3 V)`` the coordinates of the taxels from those of the vertices.
        bones: ``(T,)`` bone of each taxel.
        smooth: ``(3 V, 3 V)`` the shift of a vertex less the mean shift of its neighbours.
    """

    free: sparse.csr_matrix
    start: Floats
    taxels: sparse.csr_matrix
    bones: Indices
    smooth: sparse.csr_matrix


def fit(loft: Loft, skeleton: Skeleton) -> float:
    """Move the points of a loft to the felt skin; the right side is the mirror image of the left.

    Returns:
        Metres, the largest distance of a taxel that is not hidden from the felt skin.
    """
    problem, felt = _problem(loft, skeleton), FeltSkin(skeleton, *binding_pose(skeleton))
    now = problem.start.copy()
    weights = np.ones(len(problem.bones))
    best, least = now, np.inf
    for _ in range(_ITERATIONS):
        points = (problem.taxels @ now).reshape(-1, 3)
        error = felt.own(problem.bones, points)
        seen = ~felt.hidden(problem.bones, points)
        worst = np.abs(error[seen]).max()
        if worst < least:
            best, least = now, worst
        large = seen & (np.abs(error) > _TOLERATED_M)
        weights = np.clip(weights * np.where(large, 1.1, 0.99), 1.0, _GREATEST_WEIGHT)
        now = _step(problem, now, error, felt.gradient(problem.bones, points), weights * seen)
    _store(loft, skeleton, best)
    return float(least)


def _step(
    problem: Problem, now: Floats, error: Floats, gradient: Floats, weights: Floats
) -> Floats:
    """Return the coordinates ``(3 V,)`` after a Gauss-Newton step."""
    count = len(error)
    rows = sparse.csr_matrix(
        (gradient.ravel(), (np.repeat(np.arange(count), 3), np.arange(3 * count)))
    )
    slope = rows @ problem.taxels @ problem.free
    smooth, shift = problem.smooth @ problem.free, now - problem.start
    scaled = slope.T @ sparse.diags(weights)
    matrix = scaled @ slope + _SMOOTH * smooth.T @ smooth + _STAY * problem.free.T @ problem.free
    downhill = scaled @ error + _SMOOTH * smooth.T @ (problem.smooth @ shift)
    downhill += _STAY * problem.free.T @ shift
    change = problem.free @ spsolve(matrix.tocsc(), -downhill)
    moved: Floats = now + change * min(1.0, _STEP_M / np.abs(change).max())
    return moved


def _problem(loft: Loft, skeleton: Skeleton) -> Problem:
    count = loft.first_right
    owners, points = np.array(loft.owners[:count]), np.array(loft.points[:count])
    positions, rotations = binding_pose(skeleton)
    world = positions[owners] + np.einsum("vij,vj->vi", rotations[owners], points)
    triangles = np.array(loft.triangles)
    mine = (triangles < count).all(axis=1)
    triangles, bones = triangles[mine], np.array(loft.triangle_bones)[mine]
    return Problem(
        free=_free_coordinates(world, loft.first_left),
        start=world.ravel(),
        taxels=sparse.kron(_taxel_rows(triangles, count), sparse.eye(3)).tocsr(),
        bones=np.repeat(bones, len(BARYCENTRIC)),
        smooth=sparse.kron(_laplacian(triangles, count), sparse.eye(3)).tocsr(),
    )


def _taxel_rows(triangles: NDArray[np.int64], count: int) -> sparse.csr_matrix:
    """Return the weights ``(6 t, V)`` of the vertices at the taxels."""
    per = len(BARYCENTRIC)
    rows = np.repeat(np.arange(per * len(triangles)), 3)
    columns = np.repeat(triangles, per, axis=0).ravel()
    values = np.tile(BARYCENTRIC, (len(triangles), 1)).ravel()
    return sparse.csr_matrix((values, (rows, columns)), (per * len(triangles), count))


def _laplacian(triangles: NDArray[np.int64], count: int) -> sparse.csr_matrix:
    """Return the matrix ``(V, V)`` of a value less the mean of its neighbours."""
    pairs = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    near = sparse.csr_matrix((np.ones(len(pairs)), pairs.T), (count, count))
    degree = np.asarray(near.sum(axis=1)).ravel()
    return (sparse.eye(count) - sparse.diags(1.0 / degree) @ near).tocsr()


def _free_coordinates(world: Floats, first_left: int) -> sparse.csr_matrix:
    """Return the map from free coordinates: the trunk's right half mirrors its left half."""
    rows, columns, values, free = [], [], [], 0
    trunk = world[:first_left]
    for vertex, point in enumerate(world):
        if vertex < first_left and point[1] < -1e-9:
            continue
        twin = -1
        if vertex < first_left:
            twin = int(np.linalg.norm(trunk - point * (1.0, -1.0, 1.0), axis=1).argmin())
        for axis in range(3):
            if axis == 1 and twin == vertex:
                continue  # stays in the median plane
            rows.append(3 * vertex + axis)
            columns.append(free)
            values.append(1.0)
            if twin not in (-1, vertex):
                rows.append(3 * twin + axis)
                columns.append(free)
                values.append(-1.0 if axis == 1 else 1.0)
            free += 1
    return sparse.csr_matrix((values, (rows, columns)), (world.size, free))


def _store(loft: Loft, skeleton: Skeleton, coordinates: Floats) -> None:
    """Write fitted coordinates ``(3 V,)`` of the binding pose into a loft."""
    positions, rotations = binding_pose(skeleton)
    world, side = coordinates.reshape(-1, 3), loft.first_right - loft.first_left
    for vertex, point in enumerate(world):
        bone = loft.owners[vertex]
        loft.points[vertex] = (point - positions[bone]) @ rotations[bone]
    for vertex in range(loft.first_right, len(loft.points)):
        loft.points[vertex] = loft.points[vertex - side] * (1.0, -1.0, 1.0)

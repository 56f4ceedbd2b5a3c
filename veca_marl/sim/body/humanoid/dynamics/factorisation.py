"""Factorisation of mass matrices of trees without fill-in.

A mass matrix is zero where two rows are on different branches of the tree. Its lower half is stored
without these zeros: element d of row i is that of column ``paths[i, d]``, see `LinkTree`.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

Indices = NDArray[np.int64]


@njit(cache=True)
def factorise(depths: Indices, paths: Indices, matrix: Floats) -> None:
    """Replace the lower half of a matrix M by L with ``M = L^T L`` (Featherstone 2008, table 6.3).

    Args:
        depths: ``(m,)``, see `LinkTree`.
        paths: ``(m, depth)``.
        matrix: ``(m, depth)`` lower half of a positive definite matrix.
    """
    for k in range(depths.shape[0] - 1, -1, -1):
        last = depths[k] - 1
        root = np.sqrt(matrix[k, last])
        matrix[k, last] = root
        for d in range(last):
            matrix[k, d] /= root
        for d in range(last):
            share, row = matrix[k, d], paths[k, d]
            for e in range(d + 1):
                matrix[row, e] -= share * matrix[k, e]


@njit(cache=True)
def solve(depths: Indices, paths: Indices, factor: Floats, x: Floats) -> None:
    """Replace the right side ``(m,)`` by the solution, with the factor from `factorise`."""
    for i in range(depths.shape[0] - 1, -1, -1):
        last = depths[i] - 1
        x[i] /= factor[i, last]
        for d in range(last):
            x[paths[i, d]] -= factor[i, d] * x[i]
    for i in range(depths.shape[0]):
        last = depths[i] - 1
        for d in range(last):
            x[i] -= factor[i, d] * x[paths[i, d]]
        x[i] /= factor[i, last]


@njit(cache=True)
def add_product(depths: Indices, paths: Indices, matrix: Floats, x: Floats, out: Floats) -> None:
    """Add the product of a matrix and a vector ``(m,)`` to `out`."""
    for i in range(depths.shape[0]):
        last = depths[i] - 1
        out[i] += matrix[i, last] * x[i]
        for d in range(last):
            column = paths[i, d]
            out[i] += matrix[i, d] * x[column]
            out[column] += matrix[i, d] * x[i]


def dense(depths: Indices, paths: Indices, matrix: Floats) -> Floats:
    """Return a stored matrix as an array ``(m, m)``."""
    full = np.zeros((len(depths), len(depths)))
    for row, depth in enumerate(depths):
        columns = paths[row, :depth]
        full[row, columns] = full[columns, row] = matrix[row, :depth]
    return full

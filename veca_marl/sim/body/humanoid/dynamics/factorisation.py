"""Factorisation of mass matrices of trees without fill-in."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats


@njit(cache=True)
def factorise(previous_rows: NDArray[np.int64], matrix: Floats) -> None:
    """Replace the lower half of a matrix M by L with ``M = L^T L`` (Featherstone 2008, table 6.3).

    Args:
        previous_rows: ``(m,)``, see `LinkTree`.
        matrix: ``(m, m)`` symmetric, positive definite, with the sparsity of a mass matrix.
    """
    for k in range(previous_rows.shape[0] - 1, -1, -1):
        root = np.sqrt(matrix[k, k])
        matrix[k, k] = root
        i = previous_rows[k]
        while i >= 0:
            matrix[k, i] /= root
            i = previous_rows[i]
        i = previous_rows[k]
        while i >= 0:
            share, j = matrix[k, i], i
            while j >= 0:
                matrix[i, j] -= share * matrix[k, j]
                j = previous_rows[j]
            i = previous_rows[i]


@njit(cache=True)
def solve(previous_rows: NDArray[np.int64], factor: Floats, x: Floats) -> None:
    """Replace the right side ``(m,)`` by the solution, with the factor from `factorise`."""
    for i in range(previous_rows.shape[0] - 1, -1, -1):
        x[i] /= factor[i, i]
        j = previous_rows[i]
        while j >= 0:
            x[j] -= factor[i, j] * x[i]
            j = previous_rows[j]
    for i in range(previous_rows.shape[0]):
        j = previous_rows[i]
        while j >= 0:
            x[i] -= factor[i, j] * x[j]
            j = previous_rows[j]
        x[i] /= factor[i, i]

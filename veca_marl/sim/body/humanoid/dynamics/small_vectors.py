"""Products of vectors and matrices of three dimensions, written to arrays that are given."""

from __future__ import annotations

from numba import njit

from veca_marl.sim.geometry import Floats


@njit(cache=True)
def cross_into(a: Floats, b: Floats, out: Floats) -> None:
    """Write the cross product of two vectors ``(3,)``; `out` must be another array."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def add_cross(a: Floats, b: Floats, out: Floats) -> None:
    """Add the cross product of two vectors ``(3,)`` to `out`, which must be another array."""
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def multiply_into(a: Floats, b: Floats, out: Floats) -> None:
    """Write the product of two matrices ``(3, 3)``; `out` must be another array."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True)
def add_rotated(rotation: Floats, vector: Floats, out: Floats) -> None:
    """Add a rotated vector ``(3,)`` to `out`, which must be another array."""
    for i in range(3):
        out[i] += (
            rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]
        )

"""Predicted paths of a toy car, which draws another point when it has reached one."""

from __future__ import annotations

import cmath

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.tasks.cars.toy_car import ARRIVED_M, SLOWEST, ToyCar
from veca_marl.sim.geometry import Floats


def car_paths(car: ToyCar, nexts: Floats, steps: int, step_s: float) -> Floats:
    """Return where a car will be if it drives to its point and then on to one of several others.

    It moves as by `Motion.towards`, and stays where it arrives then. Nothing stops it.

    Args:
        car: The car.
        nexts: Points that it may draw when it has reached its present one, ``(n, 2)`` metres.
        steps: Number of steps.
        step_s: Duration of a step.

    Returns:
        Positions after each step, ``(n, steps, 2)`` metres, or ``(1, steps, 2)`` if it does not
        reach its present point.
    """
    # points of the floor as complex numbers: a product with a direction is a rotation
    place, point = _complex(car.prop.position[None]), _complex(car.point[None])
    direction = np.array([cmath.exp(1j * car.heading_rad)])
    most_rad, step_m = car.motion.turn_radps * step_s, car.motion.speed_mps * step_s
    draws, path = car.needs_point, []
    for _ in range(steps):
        if len(point) == 1 and (draws or abs(point[0] - place[0]) < ARRIVED_M):
            point, draws = _complex(nexts), False
        way = point - place
        bearing = np.angle(way * direction.conj())
        moved_m = step_m * np.maximum(np.cos(bearing), SLOWEST) * (np.abs(way) >= ARRIVED_M)
        place = place + moved_m * direction
        direction = direction * np.exp(1j * np.minimum(np.maximum(bearing, -most_rad), most_rad))
        path.append(place)
    places = np.stack(np.broadcast_arrays(*path), axis=1)
    return np.stack([places.real, places.imag], axis=-1)


def room_points(car: ToyCar, along: int) -> Floats:
    """Return points spread evenly over the floor of a car's room, ``(along ** 2, 2)`` metres."""
    low, size = np.array(car.room.lower_m[:2]), np.array(car.room.size_m[:2])
    cells = np.moveaxis(np.indices((along, along)), 0, -1).reshape(-1, 2)
    points: Floats = low + size * (cells + 0.5) / along
    return points


def _complex(points: Floats) -> NDArray[np.complex128]:
    """Return points ``(n, 2)`` or ``(n, 3)`` of the floor as ``x + iy``, ``(n,)``."""
    numbers: NDArray[np.complex128] = points[:, 0] + 1j * points[:, 1]
    return numbers

"""Soft shadows of the sun, for pictures that people look at; eyes of agents do not see them.

A shadow map (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978) holds the depth
of the nearest surface as seen from the sun. The sun is a disc: the fraction of it that a point sees
is estimated by percentage-closer soft shadows (Fernando, SIGGRAPH 2005 sketches), so that shadows
are sharp where things touch and soft far away from what casts them. Depths are compared with the
tangent plane of the receiving surface, so that a surface casts no shadow on itself.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.vision.rasterizer import Depths, Lens, Surfaces

Plane: TypeAlias = tuple[float, float, float, float, float, float]
"""A point in the frame of the sun's camera (metres right, up and away), by how much the surface
there recedes per metre to the right and upwards, and by how much another one has to be nearer."""

SUN_RADIUS = 0.07
"""Tangent of the angular radius of the sun, which is that of a bright window."""

_SEARCHED_M = 0.10  # radius in which surfaces that cast shadows are searched
_MARGIN_M = 0.006  # by which a surface has to be nearer to the sun
_STEEPEST = 4.0  # slope of a receiving surface against the plane of the map
_GOLDEN_RAD = math.pi * (3.0 - math.sqrt(5.0))
_BLOCKERS, _SAMPLES = 14, 14


def _disc(count: int, power: float) -> Floats:
    """Return points ``(count, 2)`` of the unit disc; a power above 0.5 is denser in its middle."""
    fractions = (np.arange(count) + 0.5) / count
    angles = np.arange(count) * _GOLDEN_RAD
    points: Floats = (fractions**power)[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
    return points


BLOCKER_DISC, SAMPLE_DISC = _disc(_BLOCKERS, 1.5), _disc(_SAMPLES, 0.5)


@kernel
def sunlit_fractions(
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    sun_view: Floats,
    sun_lens: Lens,
    shadow_map: Depths,
    tallest: Depths,
    discs: tuple[Floats, Floats],
    fractions: NDArray[np.float32],
) -> None:
    """Estimate the fraction of the sun that the visible points of an image see.

    Args:
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres along the optical axis.
        surfaces: ``(H, W)`` visible surfaces, negative where there is none.
        sun_view: As `view`, of a distant camera in the direction of the sun.
        sun_lens: Its parameters.
        shadow_map: ``(N, N)`` metres, its depths.
        tallest: ``(N, N)`` metres, from `tallest_nearby`.
        discs: `BLOCKER_DISC` and `SAMPLE_DISC`.
        fractions: ``(H, W)`` in [0, 1], written; -1 where the surface faces away from the sun.
    """
    height, width = depth.shape
    for j in range(height):
        for i in range(width):
            fractions[j, i] = 1.0
            if surfaces[j, i] < 0:
                continue
            px, py, pz = _point(view, lens, depth, j, i)
            nx, ny, nz = _normal(view, lens, depth, surfaces, j, i)
            facing = -(nx * sun_view[3, 0] + ny * sun_view[3, 1] + nz * sun_view[3, 2])
            if facing <= 0.0:
                fractions[j, i] = -1.0
                continue
            across = nx * sun_view[1, 0] + ny * sun_view[1, 1] + nz * sun_view[1, 2]
            upward = nx * sun_view[2, 0] + ny * sun_view[2, 1] + nz * sun_view[2, 2]
            slope_x = min(max(across / facing, -_STEEPEST), _STEEPEST)
            slope_y = min(max(upward / facing, -_STEEPEST), _STEEPEST)
            dx, dy, dz = px - sun_view[0, 0], py - sun_view[0, 1], pz - sun_view[0, 2]
            right = dx * sun_view[1, 0] + dy * sun_view[1, 1] + dz * sun_view[1, 2]
            up = dx * sun_view[2, 0] + dy * sun_view[2, 1] + dz * sun_view[2, 2]
            away = dx * sun_view[3, 0] + dy * sun_view[3, 1] + dz * sun_view[3, 2]
            if _is_open(right, up, away, sun_view, sun_lens, tallest):
                continue
            turn = _noise(i, j) * 2.0 * math.pi
            texel_m = 2.0 * sun_lens.tan_x * away / shadow_map.shape[0]
            margin_m = _MARGIN_M + texel_m * (abs(slope_x) + abs(slope_y))
            plane = right, up, away, slope_x, slope_y, margin_m
            fractions[j, i] = _fraction(
                plane, math.cos(turn), math.sin(turn), discs, sun_lens, shadow_map
            )


def tallest_nearby(shadow_map: Depths, sun_view: Floats, sun_lens: Lens) -> Depths:
    """Return ``(N, N)`` how far, along the rays of the map, things near each ray are off the floor.

    Args:
        shadow_map: ``(N, N)`` metres.
        sun_view: ``(4, 3)`` axes of the camera of the map.
        sun_lens: Its parameters.
    """
    x, y = sun_lens.columns[None, :], sun_lens.rows[:, None]
    falling = (sun_view[3, 2] + x * sun_view[1, 2] + y * sun_view[2, 2]).astype(np.float32)
    heights = np.float32(sun_view[0, 2]) / -falling - shadow_map
    texel_m = 2.0 * sun_lens.tan_x * float(np.median(shadow_map)) / len(shadow_map)
    reach = 2 * math.ceil(_SEARCHED_M / texel_m) + 3
    return np.asarray(cv2.dilate(heights, np.ones((reach, reach), np.uint8)), np.float32)


@inlined
def _is_open(
    right: float, up: float, away: float, sun_view: Floats, lens: Lens, tallest: Depths
) -> bool:
    """Return whether nothing near a point is higher above the floor than the point itself."""
    size = tallest.shape[0]
    x, y = right / away, up / away
    column = int((x / lens.tan_x + 1.0) * 0.5 * size)
    row = int((1.0 - y / lens.tan_y) * 0.5 * size)
    if column < 0 or row < 0 or column >= size or row >= size:
        return True
    falling = sun_view[3, 2] + x * sun_view[1, 2] + y * sun_view[2, 2]
    height = sun_view[0, 2] / -falling - away
    return bool(tallest[row, column] <= height + _MARGIN_M)


@inlined
def _noise(i: int, j: int) -> float:
    """Return a number in [0, 1) of a pixel (Jimenez 2014, interleaved gradient noise)."""
    mixed = 0.06711056 * i + 0.00583715 * j
    mixed = 52.9829189 * (mixed - math.floor(mixed))
    return mixed - math.floor(mixed)


@kernel
def _fraction(
    plane: Plane,
    cosine: float,
    sine: float,
    discs: tuple[Floats, Floats],
    lens: Lens,
    shadow_map: Depths,
) -> float:
    """Return the fraction of the sun that one point sees.

    Args:
        plane: The point and the surface round it.
        cosine: Of the angle by which the patterns of samples are turned.
        sine: Likewise.
        discs: `BLOCKER_DISC` and `SAMPLE_DISC`.
        lens: Parameters of the sun's camera.
        shadow_map: ``(N, N)`` its depths.
    """
    blockers, samples = discs
    margin_m = plane[5]
    found, total = 0, 0.0
    for k in range(blockers.shape[0]):
        a, b = _SEARCHED_M * blockers[k, 0], _SEARCHED_M * blockers[k, 1]
        gap = _gap(plane, a * cosine - b * sine, a * sine + b * cosine, lens, shadow_map)
        # a surface beside the cone between the point and the sun hides nothing of it
        if gap > margin_m and gap * SUN_RADIUS * 1.5 + 0.01 > math.sqrt(a * a + b * b):
            found, total = found + 1, total + gap
    if found == 0:
        return 1.0
    spread = min(max(SUN_RADIUS * total / found, 0.004), _SEARCHED_M)
    seen = 0
    for k in range(samples.shape[0]):
        a, b = spread * samples[k, 0], spread * samples[k, 1]
        gap = _gap(plane, a * cosine - b * sine, a * sine + b * cosine, lens, shadow_map)
        seen += gap <= margin_m
    return float(seen / samples.shape[0])


@inlined
def _gap(plane: Plane, x: float, y: float, lens: Lens, shadow_map: Depths) -> float:
    """Return by how much the map is nearer to the sun than the receiving plane beside a point."""
    right, up, away, slope_x, slope_y, _ = plane
    size = shadow_map.shape[0]
    expected = away + x * slope_x + y * slope_y
    column = int(((right + x) / expected / lens.tan_x + 1.0) * 0.5 * size)
    row = int((1.0 - (up + y) / expected / lens.tan_y) * 0.5 * size)
    if column < 0 or row < 0 or column >= size or row >= size:
        return 0.0
    return float(expected - shadow_map[row, column])


@inlined
def _point(view: Floats, lens: Lens, depth: Depths, j: int, i: int) -> tuple[float, float, float]:
    """Return the point that a pixel shows, world frame."""
    x, y, t = lens.columns[i], lens.rows[j], depth[j, i]
    return (
        view[0, 0] + t * (view[3, 0] + x * view[1, 0] + y * view[2, 0]),
        view[0, 1] + t * (view[3, 1] + x * view[1, 1] + y * view[2, 1]),
        view[0, 2] + t * (view[3, 2] + x * view[1, 2] + y * view[2, 2]),
    )


@kernel
def _normal(
    view: Floats, lens: Lens, depth: Depths, surfaces: Surfaces, j: int, i: int
) -> tuple[float, float, float]:
    """Return the unit normal of the visible surface, from the nearer neighbours in depth."""
    height, width = depth.shape
    low, high = max(i - 1, 0), min(i + 1, width - 1)
    side = low if abs(depth[j, low] - depth[j, i]) < abs(depth[j, high] - depth[j, i]) else high
    if low == i:
        side = high
    elif high == i:
        side = low
    top, base = max(j - 1, 0), min(j + 1, height - 1)
    other = top if abs(depth[top, i] - depth[j, i]) < abs(depth[base, i] - depth[j, i]) else base
    if top == j:
        other = base
    elif base == j:
        other = top
    px, py, pz = _point(view, lens, depth, j, i)
    ax, ay, az = _point(view, lens, depth, j, side)
    bx, by, bz = _point(view, lens, depth, other, i)
    ax, ay, az, bx, by, bz = ax - px, ay - py, az - pz, bx - px, by - py, bz - pz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    # towards the camera
    sign = nx * (px - view[0, 0]) + ny * (py - view[0, 1]) + nz * (pz - view[0, 2])
    length = -length if sign > 0.0 else length
    return nx / length, ny / length, nz / length

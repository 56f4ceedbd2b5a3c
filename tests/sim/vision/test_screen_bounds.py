"""Screen bounds compared with silhouettes of densely sampled surfaces: safe and tight."""

import numpy as np
import pytest
from eye_scenes import random_rotations

from veca_marl.sim.vision.rasterizer import box_intervals, disc_interval, rod_interval

LIMIT = 1.5
NEAR = 0.01


def slopes_ahead(across, forward):
    """Least and greatest slope of the points in front of the camera, clipped to the image."""
    ahead = forward > NEAR
    if not ahead.any():
        return LIMIT, -LIMIT
    slopes = across[ahead] / forward[ahead]
    return np.clip((slopes.min(), slopes.max()), -LIMIT, LIMIT)


def test_disc_tangents():
    rng = np.random.default_rng(0)
    angles = np.linspace(0, 2 * np.pi, 20_000)
    for _ in range(300):
        across, forward = rng.uniform(-3, 3, 2)
        radius = rng.uniform(0.05, 2.0)
        low, high = slopes_ahead(
            across + radius * np.cos(angles), forward + radius * np.sin(angles)
        )
        got_low, got_high = np.clip(disc_interval(across, forward, radius, LIMIT), -LIMIT, LIMIT)
        if np.hypot(across, forward) <= radius:
            assert (got_low, got_high) == (-LIMIT, LIMIT)
        elif high > low:
            # the near plane cuts off a sliver that the tangents do not know of
            assert got_low <= low + 1e-9
            assert got_high >= high - 1e-9
            assert got_low == pytest.approx(low, abs=0.02) or forward < radius
            assert got_high == pytest.approx(high, abs=0.02) or forward < radius


def test_rod_in_front_is_bounded_by_its_caps():
    rng = np.random.default_rng(1)
    angles = np.linspace(0, 2 * np.pi, 5000)
    for _ in range(200):
        across, forward = rng.uniform(-2, 2), rng.uniform(2.0, 4.0)
        radius, half = rng.uniform(0.05, 0.5), rng.uniform(0.0, 1.0)
        turn = rng.uniform(0, 2 * np.pi)
        axis = np.cos(turn), np.sin(turn)
        ends = np.array([half, -half])[:, None]
        low, high = slopes_ahead(
            (across + ends * axis[0] + radius * np.cos(angles)).ravel(),
            (forward + ends * axis[1] + radius * np.sin(angles)).ravel(),
        )
        got = np.clip(rod_interval(across, forward, *axis, half, radius, LIMIT), -LIMIT, LIMIT)
        if low < high:
            assert got == pytest.approx((low, high), abs=1e-3)


def test_a_rod_behind_the_camera_whose_surface_reaches_before_it_is_bounded():
    """Its ends are on both sides of the camera, one cap in front of its plane, the other behind."""
    rng = np.random.default_rng(4)
    angles, steps = np.linspace(0, 2 * np.pi, 200), np.linspace(-1.0, 1.0, 400)
    seen = 0
    for _ in range(300):
        radius, near = rng.uniform(0.02, 0.5), rng.uniform(0.0, 1.0)
        one = np.array([-rng.uniform(0.1, 5.0), -near * radius])
        other = np.array([rng.uniform(1.0, 30.0), -rng.uniform(0.5, 3.0)]) * radius
        middle, way = (one + other) / 2.0, (other - one) / 2.0
        half = np.linalg.norm(way)
        points = middle + steps[:, None] * way
        low, high = slopes_ahead(
            (points[:, :1] + radius * np.cos(angles)).ravel(),
            (points[:, 1:] + radius * np.sin(angles)).ravel(),
        )
        if low < high:
            seen += 1
            got = rod_interval(*middle, *(way / half), half, radius, LIMIT)
            assert got[0] <= low + 1e-9
            assert got[1] >= high - 1e-9
    assert seen > 100


def test_box_is_bounded_by_its_edges():
    rng = np.random.default_rng(2)
    along = np.linspace(-1, 1, 60)
    cube = np.stack(np.meshgrid(along, along, along), -1).reshape(-1, 3)
    cube = cube[np.abs(cube).max(1) == 1.0]
    for rotation in random_rotations(100, rng):
        half, centre = rng.uniform(0.1, 1.0, 3), rng.uniform((-2, -2, -1), (2, 2, 4))
        right, up, forward = (tuple(axis) for axis in rotation)
        got = box_intervals(tuple(centre), tuple(half), right, up, forward, NEAR)
        seen = centre + (cube * half) @ rotation.T
        ahead = seen[:, 2] > NEAR
        if not ahead.any():
            continue
        for axis, (low, high) in enumerate(got):
            slopes = seen[ahead, axis] / seen[ahead, 2]
            assert low <= slopes.min() + 1e-9
            assert high >= slopes.max() - 1e-9
            if ahead.all():
                assert (low, high) == pytest.approx((slopes.min(), slopes.max()), abs=1e-9)
